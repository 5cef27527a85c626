// The legend: what the colours of the scene mean.
import { CLASSES, CONNECTION, OTHER, PALE, REMAINDER_CSS, STEPS, STOCK, UNCUT, UNNAMED, css, toolColour, wallColour, zoneColour, type RGB } from "../scene/colours";
import type { Mode } from "../scene/part";
import { add, el, swatch } from "../shared/dom";
import type { ViewHead } from "../shared/view-file";
import { cutterWords } from "../shared/wording";

const MAX_WALLS = 8;
const MAX_CONNECTIONS = 6;
const MAX_ZONES = 10;

/** `drawn`: T numbers of the tools whose paths are drawn; `stock`: whether the stock is. */
export function legendOf(h: ViewHead, mode: Mode, drawn: Set<number>, stock: boolean): (Node | null)[] {
  const stockEntry = stock ? entry(css(STOCK), "stock at this time") : null;
  if (mode === "deviation") return [...scale(h), entries(entry(css(UNCUT), "uncut", true), entry(css(PALE), "not measured"), stockEntry)];
  const areas = mode === "walls" ? wallEntries(h) : zoneEntries(h);
  add(areas, stockEntry);
  return [areas, drawn.size ? toolEntries(h, drawn) : null];
}

function scale(h: ViewHead): Node[] {
  const { gouge: low, scallop: high } = h.budget_mm;
  const ends = [-STEPS[1]! * low, -STEPS[0]! * low, -low, high, STEPS[0]! * high, STEPS[1]! * high];
  const cell = (c: RGB, below: string): HTMLElement => {
    const node = el("span", { class: "cell" }, el("i", {}), el("small", {}, below));
    node.style.setProperty("--colour", css(c));
    return node;
  };
  const words = (v: number): string => `${v > 0 ? "+" : "−"}${Math.abs(v).toFixed(Math.abs(v) < 0.1 ? 3 : 2)}`;
  return [el("div", { class: "scale", role: "img", "aria-label": `Scale: green is at most ${low} mm too deep and at most ${high} mm of stock left, red is deeper, blue is more stock left` },
    ...CLASSES.map((c, i) => cell(c, i < ends.length ? words(ends[i]!) : "mm"))),
    el("div", { class: "scalewords" }, el("span", {}, "too deep"), el("span", {}, "allowed"), el("span", {}, "stock left"))];
}

function wallEntries(h: ViewHead): HTMLElement {
  const ids = h.connections.slice(0, MAX_CONNECTIONS).map((c) => c.id).join(" ");
  return entries(...h.walls.slice(0, MAX_WALLS).map((w, i) => entry(css(wallColour(i)), w.id)), more(h.walls.length - MAX_WALLS),
    h.connections.length ? entry(css(CONNECTION), `connection${h.connections.length > 1 ? "s" : ""} ${ids}`) : null,
    entry(css(UNNAMED), "floor and other faces"));
}

function zoneEntries(h: ViewHead): HTMLElement {
  return entries(...h.zones.slice(0, MAX_ZONES).map((z, i) => entry(css(zoneColour(i)), z.id)), more(h.zones.length - MAX_ZONES),
    h.remainder.length ? entry(REMAINDER_CSS, "remainder", true) : null, entry(css(OTHER), "in no zone"));
}

function toolEntries(h: ViewHead, drawn: Set<number>): HTMLElement {
  return entries(...h.tools.map((t, i) => (drawn.has(t.number) ? entry(css(toolColour(i)), `T${t.number} ${cutterWords(t, t.taper_deg)}`, false, true) : null)));
}

function entries(...all: (HTMLElement | null)[]): HTMLElement {
  return el("div", { class: "entries" }, ...all);
}

function more(n: number): HTMLElement | null {
  return n > 0 ? el("span", { class: "entry" }, `and ${n} more`) : null;
}

function entry(colour: string, words: string, hatched = false, line = false): HTMLElement {
  const s = swatch(colour, hatched);
  if (line) s.classList.add("line");
  return el("span", { class: "entry" }, s, words);
}
