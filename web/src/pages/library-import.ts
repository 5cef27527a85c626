// Import of a tool library in the form of a new job: a file, the dry run, and the tools that the user takes.
import { RequestError, ask, type LibraryImport } from "../shared/api";
import { el, field, fill } from "../shared/dom";
import { counted } from "../shared/wording";
import type { ToolRow } from "./tool-table";

const SHOWN = 300; // entries in the table; a library may have thousands
const MAX_TOOLS = 200; // of a setup
const ENDINGS = ".json,.tools,.hsmlib,.xml,.omtdx,.fctb,.fctl,.zip,.tbl,.p21,.stp,.csv,.xlsx";
const VERDICTS: Record<string, string> = { taken: "taken", noted: "taken with notes", left_out: "left out" };

type Entry = LibraryImport["entries"][number];

export class LibraryImportPanel {
  readonly node: HTMLElement;
  private readonly file = el("input", { type: "file", id: "libraryfile", accept: ENDINGS, onchange: () => void this.read() });
  private readonly unit = el("select", { id: "libraryunit", onchange: () => void this.read() },
    el("option", { value: "" }, "as the library states"), el("option", { value: "mm" }, "mm"), el("option", { value: "in" }, "inch"));
  private readonly answer = el("div", { class: "answer", "aria-live": "polite" });
  private reading = 0;

  /** `onTake` gets the tools that the user takes, and whether they replace those of the table. */
  constructor(private readonly onTake: (tools: ToolRow[], replace: boolean) => void) {
    this.node = el("details", { class: "library" }, el("summary", {}, "Import a tool library"),
      el("div", { class: "fields" }, field("Library", this.file, "Fusion, HSMWorks, FreeCAD, LinuxCNC, ISO 13399, DIN 4000, hyperMILL, SolidCAM, CSV or XLSX."),
        field("Unit, where the library states none", this.unit)), this.answer);
  }

  private async read(): Promise<void> {
    const file = this.file.files?.[0];
    if (!file) return;
    const turn = ++this.reading;
    fill(this.answer, el("p", {}, "Reading…"));
    const body = new FormData();
    body.append("library", file);
    try {
      const query = this.unit.value ? `&unit=${this.unit.value}` : "";
      const found = (await (await ask(`/v1/tools:import?dry_run=true${query}`, { method: "POST", body })).json()) as LibraryImport;
      if (turn === this.reading) this.show(found);
    } catch (error) {
      if (turn !== this.reading) return;
      const problem = error instanceof RequestError ? error.problem : { detail: String(error) };
      const remedy = problem.code === "unit_missing" ? "Choose the unit above." : problem.remedy;
      fill(this.answer, el("p", { class: "bad" }, problem.detail ?? "The library cannot be read."), remedy ? el("p", { class: "hint" }, remedy) : null);
    }
  }

  private show(found: LibraryImport): void {
    const boxes = new Map<Entry, HTMLInputElement>();
    const rows = found.entries.slice(0, SHOWN).map((entry) => {
      const box = el("input", { type: "checkbox", checked: entry.tool !== null, disabled: entry.tool === null, "aria-label": `Take ${entry.name ?? entry.place}`, onchange: () => label() });
      boxes.set(entry, box);
      return row(entry, box);
    });
    const chosen = (): ToolRow[] => found.entries.filter((e) => e.tool && (boxes.get(e)?.checked ?? false)).map((e) => plain(e.tool!));
    const adding = el("button", { type: "button", onclick: () => this.onTake(chosen(), false) });
    const replacing = el("button", { type: "button", onclick: () => this.onTake(chosen(), true) });
    const label = (): void => {
      const count = chosen().length;
      fill(adding, `Add ${counted(count, "tool")}`);
      fill(replacing, `Replace the table by ${counted(count, "tool")}`);
      for (const button of [adding, replacing]) button.disabled = count === 0 || count > MAX_TOOLS;
    };
    label();
    fill(this.answer, el("p", {}, `Read as ${found.format}: ${found.taken} taken, ${found.noted} taken with notes, ${found.left_out} left out.`),
      found.entries.length > SHOWN ? el("p", { class: "hint" }, `The table shows the first ${SHOWN} of ${found.entries.length} entries. zonemill tools import takes all of them.`) : null,
      el("div", { class: "wide", tabindex: 0, role: "group", "aria-label": "Entries of the library" }, el("table", { class: "rows2" },
        el("thead", {}, el("tr", {}, ...["Take", "Entry", "Tool", "T", "Result", "Notes"].map((h) => el("th", { scope: "col" }, h)))), el("tbody", {}, ...rows))),
      el("p", { class: "hint" }, `A setup has at most ${MAX_TOOLS} tools, each with its own T number.`),
      el("p", { class: "buttons" }, adding, replacing));
  }
}

function row(entry: Entry, box: HTMLElement): HTMLElement {
  const words = entry.reason ? [entry.reason] : (entry.notes ?? []);
  const tool = entry.tool ? `${entry.tool.kind} D${entry.tool.diameter_mm}` : (entry.stated_kind ?? "");
  const name = entry.library_id || entry.description || entry.place;
  const number = entry.t_number === null || entry.t_number === undefined ? "" : String(entry.t_number);
  return el("tr", {}, el("td", {}, box), ...[name, tool, number, VERDICTS[entry.verdict] ?? entry.verdict, words.join("; ")].map((text) => el("td", {}, text)));
}

/** A tool without the fields that are not stated. */
function plain(tool: NonNullable<Entry["tool"]>): ToolRow {
  return Object.fromEntries(Object.entries(tool).filter(([, value]) => value !== null)) as unknown as ToolRow;
}
