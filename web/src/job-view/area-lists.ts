// Lists of zones and remainder: a pressed entry stands out in the scene.
import { REMAINDER_CSS, css, zoneColour } from "../scene/colours";
import type { P3 } from "../scene/coordinates";
import { add, el, figure, swatch } from "../shared/dom";
import type { ViewHead, ViewRest } from "../shared/view-file";
import { needs, slenderness, spaced } from "../shared/wording";

type OnHighlight = (labels: Set<number> | null) => void;

export function zoneList(h: ViewHead, onHighlight: OnHighlight): HTMLElement {
  const list = el("ul", { class: "rows" });
  h.zones.forEach((z, i) => {
    const label = h.labelled.findIndex((x) => x.zone === z.id);
    const scallop = z.scallop_mm?.p99 ?? null;
    add(list, el("li", {}, el("button", { type: "button", "aria-pressed": "false", onclick: (e: Event) => press(e, [label], onHighlight) },
      swatch(css(zoneColour(i))), el("strong", {}, z.id), ` ${spaced(z.strategy)}, ${z.tool}`,
      el("span", { class: "where" }, `${figure(z.area_mm2, 0, "mm²")}${scallop === null ? "" : `, scallop ${figure(scallop, 3, "mm")}`}`))));
  });
  return list;
}

/** Entries of the remainder with the same reason and the same needed tool, the largest area first. */
export function remainderList(h: ViewHead, onHighlight: OnHighlight, onPlace: (point: P3) => void): HTMLElement {
  const list = el("ul", { class: "rows" });
  const groups = new Map<string, ViewRest[]>();
  for (const r of h.remainder) {
    const key = `${r.reason}|${needs(r)}`;
    groups.set(key, [...(groups.get(key) ?? []), r]);
  }
  const areaOf = (group: ViewRest[]): number => group.reduce((sum, r) => sum + r.area_mm2, 0);
  for (const group of [...groups.values()].sort((a, b) => areaOf(b) - areaOf(a))) {
    const first = group[0]!;
    const area = areaOf(group);
    const labels = group.map((r) => h.labelled.findIndex((x) => x.remainder === h.remainder.indexOf(r)));
    add(list, el("li", {}, el("button", { type: "button", "aria-pressed": "false", onclick: (e: Event) => {
      if (press(e, labels, onHighlight)) onPlace(first.at_mm);
    } }, swatch(REMAINDER_CSS, true), el("strong", {}, first.reason), ` ${[needs(first), slenderness(group)].filter(Boolean).join(", ")}`,
      el("span", { class: "where" }, `${figure(area, area < 1 ? 2 : area < 10 ? 1 : 0, "mm²")}${group.length > 1 ? `, ${group.length} places` : ""}`))));
  }
  return list;
}

/** Presses a button, releases the others of the panel, and lets its labels stand out; returns whether it is pressed now. */
function press(event: Event, labels: number[], onHighlight: OnHighlight): boolean {
  const button = event.currentTarget as HTMLElement;
  const on = button.getAttribute("aria-pressed") !== "true";
  for (const other of button.closest(".panel")!.querySelectorAll(".rows button")) other.setAttribute("aria-pressed", "false");
  button.setAttribute("aria-pressed", String(on));
  onHighlight(on ? new Set(labels) : null);
  return on;
}
