// Keys of the 3D view, and their table.
import type { P3 } from "../scene/coordinates";
import type { Mode } from "../scene/part";
import { el } from "../shared/dom";
import { FRONT, SIDE, TOP } from "./view-buttons";

export interface KeyTargets {
  nudge: (turn: number, tilt: number, x: number, y: number, factor: number) => void;
  fit: (direction?: P3) => void;
  setMode: (mode: Mode) => void;
  measure: () => void;
  describe: () => void;
  play: () => void;
  nextFinding: (by: 1 | -1) => void;
  clear: () => void;
  skip: (seconds: number) => void;
  help: () => void;
}

const TURN = 0.12; // rad a key
const TILT = 0.1; // rad a key
const MOVE = 0.04; // share of the camera's distance a key
const ZOOM = 0.85; // factor of the camera's distance a key

/** What each key does. */
export function keyActions(shift: boolean, to: KeyTargets): Record<string, () => void> {
  const arrow = (x: number, y: number) => (): void => (shift ? to.nudge(0, 0, -MOVE * x, -MOVE * y, 1) : to.nudge(TURN * x, -TILT * y, 0, 0, 1));
  const zoom = (factor: number) => (): void => to.nudge(0, 0, 0, 0, factor);
  return {
    ArrowLeft: arrow(-1, 0), ArrowRight: arrow(1, 0), ArrowUp: arrow(0, 1), ArrowDown: arrow(0, -1),
    "+": zoom(ZOOM), "=": zoom(ZOOM), "-": zoom(1 / ZOOM),
    f: () => to.fit(), "7": () => to.fit(TOP), "1": () => to.fit(FRONT), "3": () => to.fit(SIDE),
    z: () => to.setMode("zones"), w: () => to.setMode("walls"), d: () => to.setMode("deviation"),
    m: () => to.measure(), Enter: () => to.describe(), " ": () => to.play(),
    n: () => to.nextFinding(1), p: () => to.nextFinding(-1), Escape: () => to.clear(), ".": () => to.skip(1), ",": () => to.skip(-1), "?": () => to.help(),
  };
}

const KEYS: [keys: string, effect: string][] = [
  ["Arrows", "turn"], ["Shift + arrows", "move"], ["+ −", "zoom in, zoom out"], ["F 7 1 3", "fit, top, front, side"],
  ["Z W D", "colours: zones, walls, deviation"], ["N P", "next finding, previous finding"], ["Space", "play, pause"],
  [", .", "one second back, one second on"], ["Enter", "describe the place under the cross"], ["M", "measure"], ["Esc", "remove tool and ruler"],
];
export const KEYS_IN_WORDS = KEYS.map(([keys, effect]) => `${keys}: ${effect}`).join("; ") + ".";

export function keyTable(): HTMLElement {
  return el("table", { class: "keys" }, el("caption", {}, "Keys while the 3D view has the focus"),
    el("tbody", {}, ...KEYS.map(([keys, effect]) => el("tr", {}, el("th", { scope: "row" }, el("kbd", {}, keys)), el("td", {}, effect)))));
}
