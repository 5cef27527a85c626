// Buttons for the usual view directions.
import { OVERVIEW } from "../scene/camera";
import type { P3 } from "../scene/coordinates";
import { el } from "../shared/dom";

export const TOP: P3 = [0, -0.001, 1];
export const FRONT: P3 = [0, -1, 0.02];
export const SIDE: P3 = [1, 0, 0.02];
const BUTTONS: [text: string, label: string, direction: P3][] = [
  ["Fit", "Fit the part", OVERVIEW], ["Top", "Top view", TOP], ["Front", "Front view", FRONT], ["Side", "Side view, from the right", SIDE],
];

export function viewButtons(onDirection: (direction: P3) => void): HTMLElement {
  return el("div", { class: "viewbuttons", role: "group", "aria-label": "View direction" }, ...BUTTONS.map(([text, label, direction]) =>
    el("button", { type: "button", "aria-label": label, title: label, onclick: () => onDirection(direction) }, text)));
}
