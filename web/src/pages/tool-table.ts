// The table of tools in the form of a new job.
import type { Tool } from "../shared/api";
import { el, fill } from "../shared/dom";
import { store, stored } from "../shared/browser-storage";
import { spaced } from "../shared/wording";

type OwnTool = Partial<Record<keyof Tool, unknown>> & { id: string; kind: string; diameter_mm: number; holder?: unknown };
/** A tool of the setup, or the name of one in the library. */
export type ToolRow = OwnTool | string;

const STORED = "zonemill-tools";
const HOLDER = [{ diameter_mm: 14, diameter_top_mm: 20, length_mm: 12 }, { diameter_mm: 24, diameter_top_mm: 24, length_mm: 30 }];
const DEFAULTS: OwnTool[] = [
  { id: "T1", number: 1, kind: "flat", diameter_mm: 6, flutes: 4, flute_length_mm: 18, neck_diameter_mm: 5.8, neck_length_mm: 24, shank_diameter_mm: 6, stickout_mm: 40, holder: HOLDER },
  { id: "T2", number: 2, kind: "ball", diameter_mm: 3, flutes: 2, flute_length_mm: 9, neck_diameter_mm: 2.8, neck_length_mm: 20, shank_diameter_mm: 6, stickout_mm: 36, holder: HOLDER },
  { id: "T3", number: 3, kind: "ball", diameter_mm: 1, flutes: 2, flute_length_mm: 3, neck_diameter_mm: 0.9, neck_length_mm: 13, shank_diameter_mm: 4, stickout_mm: 29, holder: HOLDER },
];
const KINDS = ["flat", "ball", "bull", "tapered_flat", "tapered_ball", "tapered_bull", "lens", "barrel"];
const COLUMNS: { key: string; title: string; hint: string }[] = [
  { key: "number", title: "T", hint: "T number" }, { key: "kind", title: "Kind", hint: "Kind of tool" },
  { key: "diameter_mm", title: "Ø", hint: "Diameter, mm" }, { key: "corner_radius_mm", title: "Corner R", hint: "Corner radius of a bull-nose tool, a lens or a barrel, mm" },
  { key: "profile_radius_mm", title: "Profile R", hint: "Radius of the large arc of a lens or barrel, mm" },
  { key: "taper_angle_deg", title: "Taper °", hint: "Angle between the axis and the side of a tapered mill, or the upper end of a barrel, degrees" },
  { key: "flutes", title: "Teeth", hint: "Number of teeth" }, { key: "flute_length_mm", title: "Flute length", hint: "Flute length, mm" },
  { key: "neck_diameter_mm", title: "Neck Ø", hint: "Neck diameter, mm" }, { key: "neck_length_mm", title: "Neck length", hint: "Neck length, tip to shank, mm" },
  { key: "shank_diameter_mm", title: "Shank Ø", hint: "Shank diameter, mm" }, { key: "stickout_mm", title: "Stickout", hint: "Stickout, tip to holder, mm" },
];

export class ToolTable {
  readonly node = el("div", { class: "tools" });
  private tools: ToolRow[] = storedTools();

  /** `onChange` is called after each change; `labelledBy` is the id of the heading. */
  constructor(private readonly labelledBy: string, private readonly onChange: () => void) {
    this.draw();
  }

  /** The tools as the setup takes them: without what their kind does not have. */
  get value(): ToolRow[] {
    return this.tools.map((t) => {
      if (typeof t === "string") return t;
      const out = { ...t };
      const segment = out.kind === "lens" || out.kind === "barrel";
      if (!out.kind.endsWith("bull") && !segment) delete out.corner_radius_mm;
      if (!out.kind.startsWith("tapered_") && out.kind !== "barrel") delete out.taper_angle_deg;
      if (!segment) delete out.profile_radius_mm;
      return out;
    });
  }

  /** Shows the tools of a setup. They are stored only after an edit. */
  set value(tools: ToolRow[]) {
    this.tools = tools;
    this.draw();
  }

  /** Adds tools of a library, or shows them instead of those of the table. */
  take(tools: ToolRow[], replace: boolean): void {
    this.tools = replace ? tools : [...this.tools, ...tools];
    this.draw();
    this.changed();
  }

  private changed(): void {
    store("localStorage", STORED, JSON.stringify(this.tools));
    this.onChange();
  }

  /** Builds the table anew; `focus` selects what has the focus afterwards. */
  private draw(focus?: string): void {
    fill(this.node, el("div", {},
      el("table", { "aria-labelledby": this.labelledBy }, el("thead", {}, el("tr", {}, ...COLUMNS.map((c) => el("th", { scope: "col", title: c.hint }, c.title)),
        el("th", { scope: "col", title: "Standard holder of 14 to 24 mm, or the holder of the setup" }, "Holder"), el("th", { scope: "col" }, el("span", { class: "sr" }, "Remove")))),
      el("tbody", {}, ...this.tools.map((t, i) => (typeof t === "string" ? this.libraryRow(t, i) : this.ownRow(t, i))))),
      el("p", { class: "buttons" }, el("button", { type: "button", class: "add", onclick: () => this.addCopy() }, "Add a copy of the last tool"),
        el("button", { type: "button", class: "reset", onclick: () => this.reset() }, "Reset to the default tools"))));
    if (focus) this.node.querySelector<HTMLElement>(focus)?.focus();
  }

  private libraryRow(name: string, i: number): HTMLElement {
    return el("tr", {}, el("td", { colspan: COLUMNS.length + 1, class: "shelf" }, name, " ", el("span", { class: "hint" }, "from the library")), this.removeCell(i));
  }

  private ownRow(t: OwnTool, i: number): HTMLElement {
    return el("tr", {}, ...COLUMNS.map((c) => el("td", { "data-title": c.title }, this.input(t, i, c.key, `${c.hint}, tool ${i + 1}`))),
      el("td", { "data-title": "Holder" }, this.holderBox(t, i)), this.removeCell(i));
  }

  private input(t: OwnTool, i: number, key: string, label: string): HTMLElement {
    const values = t as Record<string, unknown>;
    const value = values[key];
    const input = key === "kind"
      ? el("select", { "aria-label": label }, ...(KINDS.includes(t.kind) ? KINDS : [...KINDS, t.kind]).map((k) => el("option", { value: k, selected: k === t.kind }, spaced(k))))
      : el("input", { type: "number", "aria-label": label, min: 0, step: "any", value: typeof value === "number" ? value : "" });
    input.addEventListener("change", () => {
      if (key === "kind") t.kind = input.value;
      else if (input.value === "") delete values[key];
      else values[key] = Number(input.value);
      if (key === "number") t.id = `T${input.value || i + 1}`;
      this.changed();
    });
    return input;
  }

  private holderBox(t: OwnTool, i: number): HTMLElement {
    const has = Array.isArray(t.holder) && t.holder.length > 0;
    const own = has ? t.holder : HOLDER;
    const box = el("input", { type: "checkbox", "aria-label": `Holder, tool ${i + 1}`, checked: has });
    box.addEventListener("change", () => {
      t.holder = box.checked ? structuredClone(own) : [];
      this.changed();
    });
    return box;
  }

  private removeCell(i: number): HTMLElement {
    return el("td", {}, el("button", { type: "button", "aria-label": `Remove tool ${i + 1}`, onclick: () => {
      this.tools.splice(i, 1);
      this.draw(this.tools.length ? `[aria-label="Remove tool ${Math.min(i + 1, this.tools.length)}"]` : ".add");
      this.changed();
    } }, "✕"));
  }

  private addCopy(): void {
    const own = this.tools.filter((t) => typeof t !== "string");
    const last = own[own.length - 1] ?? DEFAULTS[0]!;
    const number = Math.max(0, ...own.map((t) => Number(t.number ?? 0))) + 1;
    this.tools.push({ ...structuredClone(last), id: `T${number}`, number });
    this.draw(`[aria-label="T number, tool ${this.tools.length}"]`);
    this.changed();
  }

  private reset(): void {
    this.tools.splice(0, this.tools.length, ...structuredClone(DEFAULTS));
    this.draw(".reset");
    this.changed();
  }
}

function storedTools(): ToolRow[] {
  try {
    const found = JSON.parse(stored("localStorage", STORED) ?? "null") as ToolRow[] | null;
    if (Array.isArray(found) && found.length) return found;
  } catch {
    // what was stored cannot be read: begin with the defaults
  }
  return structuredClone(DEFAULTS);
}
