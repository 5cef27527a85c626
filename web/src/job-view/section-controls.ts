// The controls of the section: its axis, its position and its side.
import type { JobScene } from "../scene/scene";
import { el } from "../shared/dom";
import type { ViewHead } from "../shared/view-file";

/** Axis, position as a share of the part, and whether the other side is cut away. */
export interface SectionState {
  axis: 0 | 1 | 2;
  share: number;
  flipped: boolean;
}

const TICKS = 1000;
const AXES = [["", "No section"], ["0", "Across X"], ["1", "Across Y"], ["2", "Across Z"]] as const;

export class SectionControls {
  private head: ViewHead | null = null;
  private readonly axis = el("select", { id: "saxis" }, ...AXES.map(([value, text]) => el("option", { value }, text)));
  private readonly place = el("input", { type: "range", min: 0, max: TICKS, value: TICKS / 2, "aria-label": "Position of the section" });
  private readonly flip = el("input", { type: "checkbox", id: "sflip" });

  constructor(private readonly scene: JobScene, private readonly say: (text: string) => void, private readonly onChange: () => void) {
    this.axis.value = "";
    this.axis.addEventListener("input", () => {
      // the side towards the camera is cut away
      if (this.axis.value !== "") this.flip.checked = scene.isSeenFromBelow(Number(this.axis.value));
    });
    for (const x of [this.axis, this.place, this.flip]) x.addEventListener("input", () => this.cut());
  }

  begin(h: ViewHead): void {
    this.head = h;
  }

  build(): HTMLElement[] {
    return [el("label", { for: "saxis" }, "Section"), this.axis, this.place, el("span", {}, this.flip, el("label", { for: "sflip" }, "Other side"))];
  }

  get state(): SectionState | null {
    if (this.axis.value === "") return null;
    return { axis: Number(this.axis.value) as 0 | 1 | 2, share: Number(this.place.value) / TICKS, flipped: this.flip.checked };
  }

  set(state: SectionState | null): void {
    this.axis.value = state ? String(state.axis) : "";
    if (state) {
      this.place.value = String(Math.round(TICKS * state.share));
      this.flip.checked = state.flipped;
    }
    this.cut();
  }

  private cut(): void {
    const s = this.state;
    this.scene.cutAway(s?.axis ?? null, Number(this.place.value) / TICKS, this.flip.checked);
    if (s && this.head) {
      const [low, high] = this.head.bounds_mm;
      const at = low[s.axis] + s.share * (high[s.axis] - low[s.axis]);
      this.place.setAttribute("aria-valuetext", `${at.toFixed(2)} mm`);
      this.say(`Section at ${"XYZ"[s.axis]} ${at.toFixed(2)} mm`);
    }
    this.onChange();
  }
}
