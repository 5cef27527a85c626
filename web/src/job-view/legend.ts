// What the colours of the picture mean.
import { CLASSES, CONNECTION, STEPS, STOCK, UNCUT, css, toolColour, wallColour, zoneColour } from "../scene/colours";
import { add, el, swatch } from "../shared/dom";
import type { Mode } from "../scene/scene";
import type { ViewHead } from "../shared/view-file";

/** What the colours mean; `drawn` are the T numbers whose ways are shown, `stock` says whether stock is. */
export function legendOf(h: ViewHead, mode: Mode, drawn: Set<number>, stock: boolean): (Node | null)[] {
  if (mode === "deviation") {
    const low = h.budget_mm.gouge;
    const high = h.budget_mm.scallop;
    const ends = [-STEPS[1]! * low, -STEPS[0]! * low, -low, high, STEPS[0]! * high, STEPS[1]! * high];
    const cell = (c: (typeof CLASSES)[number], below: string): HTMLElement => {
      const node = el("span", { class: "cell" }, el("i", {}), el("small", {}, below));
      node.style.setProperty("--colour", css(c));
      return node;
    };
    const words = (v: number): string => `${v > 0 ? "+" : "−"}${Math.abs(v).toFixed(Math.abs(v) < 0.1 ? 3 : 2)}`;
    return [el("div", { class: "scale", role: "img", "aria-label": `Scale: green is within ${low} mm too deep and ${high} mm of stock, red is cut too deep, blue is stock left` },
      ...CLASSES.map((c, i) => cell(c, i < 6 ? words(ends[i]!) : "mm"))),
      el("div", { class: "scalewords" }, el("span", {}, "cut too deep"), el("span", {}, "allowed"), el("span", {}, "stock left")),
      el("div", { class: "entries" }, entry(css(UNCUT), "never cut", true), entry("rgb(222 222 217)", "not judged"), stock ? entry(css(STOCK), "stock at this time") : null)];
  }
  const rest = h.remainder.length ? entry("#d8191f", "stays", true) : null;
  const more = (n: number): HTMLElement | null => (n > 0 ? el("span", { class: "entry" }, `and ${n} more`) : null);
  const out: Node[] = [];
  if (mode === "walls")
    out.push(el("div", { class: "entries" }, ...h.walls.slice(0, 8).map((w, i) => entry(css(wallColour(i)), w.id)), more(h.walls.length - 8),
      h.connections.length ? entry(css(CONNECTION), `connection${h.connections.length > 1 ? "s" : ""} ${h.connections.slice(0, 6).map((c) => c.id).join(" ")}`) : null,
      entry("rgb(209 212 214)", "floor and others")));
  else
    out.push(el("div", { class: "entries" }, ...h.zones.slice(0, 10).map((z, i) => entry(css(zoneColour(i)), z.id)), more(h.zones.length - 10), rest,
      entry("rgb(184 186 191)", "in no zone")));
  if (stock) out[0]!.appendChild(entry(css(STOCK), "stock at this time"));
  if (drawn.size) {
    const list = el("div", { class: "entries" });
    h.tools.forEach((t, i) => {
      if (drawn.has(t.number)) add(list, entry(css(toolColour(i)), `T${t.number} ${t.kind} D${t.diameter_mm}`, false, true));
    });
    out.push(list);
  }
  return out;
}

function entry(colour: string, words: string, hatched = false, line = false): HTMLElement {
  const s = swatch(colour, hatched);
  if (line) s.classList.add("line");
  return el("span", { class: "entry" }, s, words);
}
