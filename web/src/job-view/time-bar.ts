// The time bar: slider, playback, and the words for the present second.
import type { ToolPosition } from "../scene/paths";
import { duration, el, fill } from "../shared/dom";
import type { ViewHead } from "../shared/view-file";
import { spaced } from "../shared/wording";

interface TimeBarEvents {
  /** `ensure`: the step of that second is to be shown. */
  onTime: (seconds: number | null, ensure: boolean) => void;
  onPlay: (on: boolean) => void;
  onStock: (on: boolean) => void;
}

const SPEEDS = [1, 10, 60, 300];
const START_SPEED = 60;
const TICKS = 10; // of the slider a second

export class TimeBar {
  readonly node = el("div", { class: "timebar" });
  /** The present second; null: no tool is shown. */
  seconds: number | null = null;
  private head: ViewHead | null = null;
  private readonly slider = el("input", { type: "range", min: 0, max: 1000, value: 1000, step: 1, "aria-label": "Machining time" });
  private readonly clock = el("output", { class: "clock", "aria-live": "off" }); // the slider says the same
  private readonly playButton = el("button", { type: "button", class: "play", "aria-label": "Play" }, "▶");
  private readonly speed = el("select", { "aria-label": "Playback speed" }, ...SPEEDS.map((v) => el("option", { value: v }, `${v}×`)));
  private readonly stock = el("input", { type: "checkbox", id: "stock", checked: true });
  private frame = 0; // of the animation, 0 while it does not play

  constructor(private readonly events: TimeBarEvents) {}

  begin(h: ViewHead, hasStock: boolean): void {
    this.head = h;
    if (!h.steps.length || !h.seconds) {
      this.node.hidden = true;
      return;
    }
    this.slider.max = String(Math.ceil(h.seconds * TICKS));
    this.slider.value = this.slider.max;
    this.slider.addEventListener("input", () => this.events.onTime(Number(this.slider.value) / TICKS, false));
    this.playButton.addEventListener("click", () => this.toggle());
    this.speed.value = String(START_SPEED);
    this.stock.addEventListener("change", () => this.events.onStock(this.stock.checked));
    fill(this.node, this.playButton, button("«", "Previous step", () => this.jump(-1)), button("»", "Next step", () => this.jump(1)),
      this.slider, this.speed, button("✕", "Remove the tool", () => this.events.onTime(null, false), "Remove the tool"),
      hasStock ? el("span", { class: "stockbox" }, this.stock, el("label", { for: "stock" }, "Stock")) : null, this.clock);
    this.show(null);
  }

  get playing(): boolean {
    return this.frame !== 0;
  }

  get stockWanted(): boolean {
    return this.stock.checked;
  }

  /** Shows `seconds` and the position of the tool then. */
  show(position: ToolPosition | null): void {
    const h = this.head!;
    this.slider.value = String(Math.round((this.seconds ?? h.seconds) * TICKS));
    if (!position || this.seconds === null) {
      this.clock.textContent = `Total ${duration(h.seconds)}. Move the slider to see the tool.`;
      this.slider.setAttribute("aria-valuetext", "no tool shown");
      return;
    }
    const words = positionWords(h, this.seconds, position);
    this.clock.textContent = words;
    this.slider.setAttribute("aria-valuetext", words);
  }

  /** Plays or pauses. */
  toggle(): void {
    if (this.playing) {
      cancelAnimationFrame(this.frame);
      this.frame = 0;
    } else {
      if (this.seconds === null || this.seconds >= this.head!.seconds) this.events.onTime(0, true);
      let last = performance.now();
      const tick = (now: number): void => {
        const to = (this.seconds ?? 0) + ((now - last) / 1000) * Number(this.speed.value);
        last = now;
        this.events.onTime(to, false);
        if (to < this.head!.seconds) this.frame = requestAnimationFrame(tick);
        else {
          this.frame = 0;
          this.playChanged();
        }
      };
      this.frame = requestAnimationFrame(tick);
    }
    this.playChanged();
  }

  private playChanged(): void {
    this.events.onPlay(this.playing);
    this.playButton.textContent = this.playing ? "❚❚" : "▶";
    this.playButton.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  /** To the start of the next step, or of the present or previous one. */
  private jump(by: 1 | -1): void {
    const h = this.head!;
    const now = this.seconds ?? h.seconds;
    const starts = h.steps.map((s) => s.start_s);
    const next = by > 0 ? starts.find((t) => t > now + 0.05) : starts.reverse().find((t) => t < now - 0.5);
    this.events.onTime(next ?? (by > 0 ? h.seconds : 0), true);
  }
}

function button(text: string, label: string, onclick: () => void, title?: string): HTMLElement {
  return el("button", { type: "button", "aria-label": label, title, onclick }, text);
}

function positionWords(h: ViewHead, seconds: number, { step, place: p, line }: ToolPosition): string {
  const s = h.steps[step]!;
  const names = [s.id === `T${s.tool}` ? "" : s.id, s.zone ?? "", spaced(s.strategy), `T${s.tool}`].filter(Boolean).join(" ");
  return `${duration(seconds)} of ${duration(h.seconds)} · ${names} · X ${p.x.toFixed(2)} Y ${p.y.toFixed(2)} Z ${p.z.toFixed(2)}${line ? ` · line ${line}` : ""}`;
}
