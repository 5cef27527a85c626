// The link to a view of a job: camera, colours, second, section and steps, as they stand in the address.
import type { Mode } from "../scene/part";
import type { SectionState } from "./section-controls";

/** What an address says; what it leaves out is undefined. */
export interface Look {
  pose?: number[];
  mode?: Mode;
  seconds?: number;
  section?: SectionState;
  steps?: Set<number>;
}

/** The complete view. */
export interface ViewState {
  pose: number[];
  mode: Mode;
  seconds: number | null;
  section: SectionState | null;
  steps: Set<number>;
}

/** Reads an address: `#c=...&m=deviation&t=12.5&s=0,0.5,0&p=1.2`. */
export function lookOf(hash: string): Look {
  const q = new URLSearchParams(hash.replace(/^#/, ""));
  const numbers = (key: string, n: number): number[] | undefined => {
    const v = (q.get(key) ?? "none").split(",").map(Number);
    return v.length === n && v.every(Number.isFinite) ? v : undefined;
  };
  const look: Look = {};
  const pose = numbers("c", 6);
  if (pose) look.pose = pose;
  const mode = q.get("m");
  if (mode === "zones" || mode === "walls" || mode === "deviation") look.mode = mode;
  const time = numbers("t", 1);
  if (time) look.seconds = time[0]!;
  const section = numbers("s", 3);
  if (section && [0, 1, 2].includes(section[0]!)) look.section = { axis: section[0] as 0 | 1 | 2, share: section[1]!, flipped: section[2] === 1 };
  const steps = q.get("p");
  if (steps) look.steps = new Set(steps.split(".").filter(Boolean).map(Number));
  return look;
}

function hashOf(view: ViewState): string {
  const q = [`c=${view.pose.join(",")}`, `m=${view.mode}`];
  if (view.seconds !== null) q.push(`t=${view.seconds.toFixed(1)}`);
  if (view.section) q.push(`s=${view.section.axis},${view.section.share},${view.section.flipped ? 1 : 0}`);
  if (view.steps.size) q.push(`p=${[...view.steps].join(".")}`);
  return `#${q.join("&")}`;
}

const PAUSE_MS = 500; // browsers refuse a page that changes its address more than a few times a second

/** Keeps the address equal to the view. */
export class LinkWriter {
  /** Until everything is loaded, the address stays as it was opened. */
  ready = false;
  private writtenAt = 0;
  private timer = 0;

  constructor(private readonly stage: HTMLElement, private readonly view: () => ViewState) {}

  /** Writes the address now or soon. */
  changed(): void {
    if (!this.ready || this.timer) return;
    const wait = this.writtenAt + PAUSE_MS - performance.now();
    if (wait <= 0) this.write();
    else this.timer = window.setTimeout(() => this.write(), wait);
  }

  write(): void {
    clearTimeout(this.timer);
    this.timer = 0;
    if (!this.ready || !this.stage.isConnected) return;
    this.writtenAt = performance.now();
    history.replaceState(null, "", hashOf(this.view()));
  }
}
