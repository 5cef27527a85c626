// Marks over the scene: names of walls and connections, and the ring around the chosen place.
import { Vector3 } from "three";
import type { JobScene } from "../scene/scene";
import { el } from "../shared/dom";
import type { ViewHead } from "../shared/view-file";

const MAX_NAMES = 40; // of walls, and of connections
const [NAME_WIDTH, NAME_HEIGHT] = [26, 18]; // px that a name takes
const HIDDEN_MS = 120; // from the last frame to the search for hidden names
const AWAY = "translate(-999px, -999px)";

export class Markers {
  readonly names = el("div", { class: "names", "aria-hidden": "true" });
  readonly ring = el("div", { class: "ring", hidden: true, "aria-hidden": "true" });
  private readonly labels: { node: HTMLElement; place: Vector3 }[] = [];
  private marked: Vector3 | null = null;
  private timer = 0;

  constructor(private readonly scene: JobScene) {}

  begin(h: ViewHead): void {
    for (const [list, kind] of [[h.walls, "wall"], [h.connections, "connection"]] as const)
      for (const { id, at_mm } of list.slice(0, MAX_NAMES))
        if (at_mm) {
          const node = el("span", { class: `name ${kind}` }, id);
          this.names.appendChild(node);
          this.labels.push({ node, place: new Vector3(...at_mm) });
        }
  }

  /** Puts the ring around a place, with words beside it. */
  mark(place: Vector3, words = ""): void {
    this.marked = place;
    this.ring.dataset.words = words;
    this.ring.hidden = false;
  }

  unmark(): void {
    this.marked = null;
    this.ring.hidden = true;
  }

  /** Moves the marks to their places in the frame that was drawn. */
  place(): void {
    if (this.marked && !this.ring.hidden) {
      const at = this.scene.screen(this.marked);
      this.ring.style.transform = at ? `translate(${at.x}px, ${at.y}px)` : AWAY;
    }
    if (this.names.hidden) return;
    const taken: { x: number; y: number }[] = [];
    for (const { node, place } of this.labels) {
      const at = this.scene.screen(place);
      const free = at && this.scene.keeps(place) && !taken.some((t) => Math.abs(t.x - at.x) < NAME_WIDTH && Math.abs(t.y - at.y) < NAME_HEIGHT);
      node.style.transform = at && free ? `translate(${at.x}px, ${at.y}px) translate(-50%, -50%)` : AWAY;
      if (at && free) taken.push(at);
    }
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      for (const { node, place } of this.labels) node.classList.toggle("behind", !this.scene.isVisible(place));
    }, HIDDEN_MS);
  }
}
