// The panel beside the scene: facts, colours, lists, files.
import type { P3 } from "../scene/coordinates";
import type { Mode } from "../scene/part";
import type { JobFiles } from "../shared/api";
import { add, duration, el, figure, percent } from "../shared/dom";
import { fileList } from "../shared/files";
import type { ViewAssumption, ViewHead } from "../shared/view-file";
import { spaced } from "../shared/wording";
import { remainderList, zoneList } from "./area-lists";
import type { FindingList } from "./finding-list";
import { keyTable } from "./keyboard";
import type { SectionControls } from "./section-controls";
import type { StepList } from "./step-list";
import { cautionCount, findingCount } from "./summary";

export interface PanelParts {
  modes: Record<Mode, HTMLInputElement>;
  findings: FindingList;
  steps: StepList;
  section: SectionControls;
  measureButton: HTMLElement;
  stepsOpen: boolean;
  onHighlight: (labels: Set<number> | null) => void;
  onPlace: (point: P3) => void;
  onCopyLink: () => void;
  onSavePicture: () => void;
}

const MODE_WORDS: Record<Mode, string> = { zones: "Zones", walls: "Walls", deviation: "Deviation" };

export function buildPanel(h: ViewHead, files: JobFiles, parts: PanelParts): (HTMLElement | null)[] {
  const clean = !h.findings.length;
  return [facts(h), colours(h, parts.modes),
    clean ? null : group(`Findings (${findingCount(h)})`, true, parts.findings.build(h)),
    cautionCount(h) ? group(`Cautions and notes (${cautionCount(h)})`, false, cautionList(h, parts.onPlace)) : null,
    h.assumed?.length ? group(`Taken for granted (${h.assumed.length})`, false, assumedList(h.assumed)) : null,
    h.zones.length ? group(`Zones (${h.zones.length})`, clean && innerWidth > 700, zoneList(h, parts.onHighlight)) : null,
    h.remainder.length ? group(`Remainder (${h.remainder.length})`, clean, remainderList(h, parts.onHighlight, parts.onPlace)) : null,
    h.steps.length ? group(`Tool paths (${h.steps.length})`, parts.stepsOpen, parts.steps.build(h)) : null,
    group("Section and measuring", false, el("div", { class: "sectiontools" }, ...parts.section.build(),
      el("p", {}, parts.measureButton, " ", el("span", { class: "hint" }, "then choose two places on the part")))),
    group("Files", false, fileList(files), files.withheld ? el("p", { class: "hint" }, `${files.withheld.split("; first finding")[0]!}.`) : null),
    group("Share and keys", false, el("p", {}, el("button", { type: "button", onclick: () => parts.onCopyLink() }, "Copy link"), " ",
      el("button", { type: "button", onclick: () => parts.onSavePicture() }, "Save picture")), keyTable())];
}

function group(title: string, open: boolean, ...children: (Node | string | null)[]): HTMLElement {
  return el("details", { open }, el("summary", {}, el("h2", {}, title)), ...children);
}

function facts(h: ViewHead): HTMLElement {
  const list = el("dl", { class: "facts" });
  const fact = (name: string, value: string): void => add(list, el("div", {}, el("dt", {}, name), el("dd", {}, value)));
  fact("Coverage", percent(h.facts.coverage));
  if (h.kind === "plan") fact("Reach coverage", percent(h.facts.reach_coverage));
  fact("Machining time", duration(h.facts.machining_time_s ?? h.seconds));
  fact("Deepest gouge", figure(h.facts.gouge_max_mm, 3, "mm"));
  fact("Gouge tolerance", figure(h.budget_mm.gouge, 3, "mm"));
  fact("Scallop height", figure(h.budget_mm.scallop, 3, "mm"));
  if (h.budget_mm.allowance) fact("Stock allowance", figure(h.budget_mm.allowance, 3, "mm"));
  return list;
}

function colours(h: ViewHead, modes: Record<Mode, HTMLInputElement>): HTMLElement {
  return el("fieldset", { class: "modes" }, el("legend", {}, "Colours"),
    ...(Object.entries(modes) as [Mode, HTMLInputElement][])
      .filter(([mode]) => h.kind === "plan" || mode !== "zones")
      .map(([mode, input]) => el("span", {}, input, el("label", { for: input.id }, MODE_WORDS[mode]))));
}

function cautionList(h: ViewHead, onPlace: (point: P3) => void): HTMLElement {
  const list = el("ul", { class: "cautions" });
  for (const c of h.cautions ?? [])
    add(list, el("li", {}, el("strong", {}, spaced(c.kind)), ` ${c.message}; ${c.remedy} `,
      c.at_mm ? el("button", { type: "button", class: "link", onclick: () => onPlace(c.at_mm!) }, "Show place") : null));
  for (const note of h.notes ?? []) add(list, el("li", {}, note));
  return list;
}

function assumedList(assumed: ViewAssumption[]): HTMLElement {
  const list = el("ul", { class: "cautions" });
  for (const a of assumed)
    add(list, el("li", {}, el("strong", {}, spaced(a.what)), `: ${a.value}. Otherwise ${a.effect}. Remedy: ${a.remedy}.`));
  return el("div", {}, el("p", { class: "hint" }, "Neither setup nor program states this. Check it on your machine."), list);
}
