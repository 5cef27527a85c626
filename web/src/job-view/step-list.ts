// The list of tool paths: which workingsteps are drawn, by operation, and whether rapids and holder are.
import { css, toolColour } from "../scene/colours";
import { add, duration, el, swatch } from "../shared/dom";
import type { ViewHead, ViewStep } from "../shared/view-file";
import { spaced, toolWords } from "../shared/wording";

interface StepListEvents {
  onSteps: () => void;
  onHolder: (on: boolean) => void;
  onTime: (seconds: number) => void;
}

/** The checkbox of an operation and those of its steps. */
interface Operation {
  all: HTMLInputElement;
  steps: number[];
}

export class StepList {
  private readonly boxes: HTMLInputElement[] = [];
  private readonly operations: Operation[] = [];
  private readonly rapids = el("input", { type: "checkbox", id: "rapids" });
  private readonly holder = el("input", { type: "checkbox", id: "holder", checked: true });

  constructor(private readonly events: StepListEvents) {
    this.rapids.addEventListener("change", () => events.onSteps());
    this.holder.addEventListener("change", () => events.onHolder(this.holder.checked));
  }

  get rapidsShown(): boolean {
    return this.rapids.checked;
  }

  /** Numbers of the steps that are drawn. */
  get shown(): Set<number> {
    return new Set(this.boxes.flatMap((box, i) => (box?.checked ? [i] : [])));
  }

  set shown(steps: Set<number>) {
    this.boxes.forEach((box, i) => (box.checked = steps.has(i)));
  }

  /** Checks a step; returns whether that changed something. */
  check(step: number): boolean {
    const box = this.boxes[step];
    if (!box || box.checked) return false;
    box.checked = true;
    return true;
  }

  /** Sets the boxes of the operations to what their steps say. */
  refresh(): void {
    for (const { all, steps } of this.operations) {
      const checked = steps.map((i) => this.boxes[i]!.checked);
      all.checked = checked.every(Boolean);
      all.indeterminate = !all.checked && checked.some(Boolean);
    }
  }

  build(h: ViewHead): HTMLElement {
    const names = [...new Set(h.steps.map((s) => s.operation))];
    return el("div", {},
      el("p", { class: "inline" }, this.rapids, el("label", { for: "rapids" }, "Rapids (dashed)"), this.holder, el("label", { for: "holder" }, "Holder")),
      h.withheld ? el("p", { class: "hint" }, `The job is unproved, so its program is withheld. The paths are drawn on a grid of ${h.path_grid_mm} mm.`) : null,
      ...names.flatMap((name) => this.operationOf(h, name)));
  }

  private operationOf(h: ViewHead, name: string): HTMLElement[] {
    const steps = h.steps.flatMap((s, i) => (s.operation === name ? [i] : []));
    const all = el("input", { type: "checkbox", id: `op-${name}`, onchange: () => {
      for (const i of steps) this.boxes[i]!.checked = all.checked;
      this.events.onSteps();
    } });
    this.operations.push({ all, steps });
    return [el("div", { class: "operation" }, all, el("label", { for: all.id }, el("strong", {}, name || "Program"), ` (${steps.length})`)),
      el("ul", { class: "rows steps" }, ...steps.map((i) => this.row(h, h.steps[i]!, i)))];
  }

  private row(h: ViewHead, s: ViewStep, i: number): HTMLElement {
    const box = el("input", { type: "checkbox", id: `step-${i}`, onchange: () => this.events.onSteps() });
    this.boxes[i] = box;
    const takes = duration(s.end_s - s.start_s);
    const tool = Math.max(0, h.tools.findIndex((t) => t.number === s.tool));
    // a step of a foreign program has no operation
    const words = [s.zone ?? (s.operation ? "several zones" : ""), spaced(s.strategy), s.operation ? `T${s.tool}` : toolWords(h, s.tool)];
    const row = el("li", {}, box, el("label", { for: box.id }, swatch(css(toolColour(tool))), el("strong", {}, s.id), ` ${words.filter(Boolean).join(", ")}`));
    add(row, el("button", { type: "button", class: "link where", "aria-label": `${takes}, go to the start of ${s.id}`, onclick: () => this.events.onTime(s.start_s) }, takes));
    return row;
  }
}
