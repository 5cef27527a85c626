// The list of findings, one of which is chosen.
import { add, el } from "../shared/dom";
import type { ViewHead } from "../shared/view-file";
import { findingCount } from "./summary";

export class FindingList {
  private buttons: HTMLButtonElement[] = [];
  private chosen = -1;

  constructor(private readonly onChoose: (i: number) => void) {}

  build(h: ViewHead): HTMLElement {
    this.buttons = h.findings.map((f, i) => el("button", { type: "button", "aria-pressed": "false", onclick: () => this.onChoose(i) },
      el("strong", {}, f.kind), " ", f.message, " ", f.line ? el("span", { class: "where" }, `${f.program} line ${f.line}`) : null));
    const list = el("ol", { class: "findings" }, ...this.buttons.map((button) => el("li", {}, button)));
    const more = findingCount(h) - h.findings.length;
    const kinds = Object.entries(h.found ?? {}).map(([kind, n]) => `${n} ${kind}`).join(", ");
    if (more > 0) add(list, el("li", { class: "hint" }, `${more} more are not listed. In total: ${kinds}.`));
    return list;
  }

  /** Marks a finding as chosen. */
  press(i: number, smooth: boolean): void {
    this.chosen = i;
    this.buttons.forEach((b, k) => b.setAttribute("aria-pressed", String(k === i)));
    this.buttons[i]!.scrollIntoView({ block: "nearest", behavior: smooth ? "smooth" : "auto" });
  }

  /** Number of the next or previous finding. */
  neighbour(by: 1 | -1): number {
    return by > 0 ? Math.min(this.buttons.length - 1, this.chosen + 1) : Math.max(0, this.chosen - 1);
  }
}
