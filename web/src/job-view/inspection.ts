// What is at a place of the scene, and the distance between two places.
import type { Vector3 } from "three";
import type { Hit } from "../scene/picking";
import type { JobScene } from "../scene/scene";
import { el } from "../shared/dom";
import type { ViewHead } from "../shared/view-file";
import { needs, slenderness } from "../shared/wording";
import type { Markers } from "./markers";

export class Inspection {
  readonly button = el("button", { type: "button", "aria-pressed": "false", onclick: () => this.toggle() }, "Measure");
  private head: ViewHead | null = null;
  private measuring = false;
  private ends: Vector3[] = [];

  /** `covered`: pixels at the lower edge of the canvas that the legend covers. */
  constructor(private readonly scene: JobScene, private readonly markers: Markers, private readonly stage: HTMLElement,
    private readonly covered: () => number, private readonly say: (text: string) => void) {}

  begin(h: ViewHead): void {
    this.head = h;
  }

  /** Describes or measures at a point of the page, CSS pixels. */
  click(x: number, y: number): void {
    const h = this.head;
    if (!h) return;
    const hit = this.scene.pick(x, y);
    if (!hit) {
      this.markers.unmark();
      this.say(this.measuring ? "No part here. Choose a place on the part." : "No part here.");
      return;
    }
    this.markers.mark(hit.point.clone());
    if (this.measuring) this.measure(hit.point.clone());
    else this.say(describe(h, hit));
    this.scene.draw();
  }

  /** Does what a click does at the cross in the centre, for use by keys. */
  describeCentre(): void {
    const box = this.scene.canvas.getBoundingClientRect();
    this.click(box.left + 0.5 * box.width, box.top + 0.5 * (box.height - this.covered()));
  }

  toggle(): void {
    this.setMeasuring(!this.measuring);
  }

  setMeasuring(on: boolean): void {
    this.measuring = on;
    this.button.setAttribute("aria-pressed", String(on));
    this.stage.classList.toggle("measuring", on);
    this.ends = [];
    this.scene.showRuler(null, null);
    this.say(on ? "Choose two places on the part to measure their distance." : "");
  }

  private measure(place: Vector3): void {
    this.ends = this.ends.length < 2 ? [...this.ends, place] : [place];
    const [a, b] = this.ends;
    this.scene.showRuler(a ?? null, b ?? null);
    if (a && b) {
      const d = b.clone().sub(a);
      this.say(`Distance ${d.length().toFixed(3)} mm: X ${d.x.toFixed(3)}, Y ${d.y.toFixed(3)}, Z ${d.z.toFixed(3)}`);
    } else this.say(`First place: ${coordinates(place)}. Choose the second place.`);
  }
}

function coordinates(p: Vector3): string {
  return `X ${p.x.toFixed(2)} Y ${p.y.toFixed(2)} Z ${p.z.toFixed(2)}`;
}

/** Face, wall, zone, reason of the remainder and deviation at a place, as far as they are known. */
function describe(h: ViewHead, hit: Hit): string {
  if (hit.cut || hit.spare !== null) {
    const words = !hit.cut ? "Stock" : hit.spare === null ? "Cut face of the part" : "Cut face of the stock";
    return `${words} · ${coordinates(hit.point)}`;
  }
  const what = hit.label < 0 ? undefined : h.labelled[hit.label];
  const connection = h.connections.find((c) => c.faces.includes(hit.face))?.id;
  const wall = h.walls.find((w) => w.faces.includes(hit.face))?.id;
  const rest = what?.remainder === undefined ? undefined : h.remainder[what.remainder];
  return [`Face F${hit.face}`, wall ? `wall ${wall}` : connection ? `connection ${connection}` : "", what?.zone ? `zone ${what.zone}` : "",
    rest ? [`remainder: ${rest.reason}`, needs(rest), slenderness([rest])].filter(Boolean).join(", ") : "",
    deviation(h, hit), coordinates(hit.point)].filter(Boolean).join(" · ");
}

/** The largest deviation near a place: 0 of `judged` is not measured, 2 is uncut. */
function deviation(h: ViewHead, { judged, left }: Hit): string {
  if (judged === 0) return "";
  if (judged === 2) return "uncut";
  const allowance = h.budget_mm.allowance ? `, not counting the stock allowance of ${h.budget_mm.allowance} mm` : "";
  return `at most ${Math.abs(left).toFixed(4)} mm ${left < 0 ? "too deep" : "left"} near here${allowance}`;
}
