// The form of a new job: fields for what most jobs need, a table of tools, and the complete setup as text.
import { RequestError, ask, type Job, type Setup } from "../shared/api";
import { add, el, field, fill } from "../shared/dom";
import { LibraryImportPanel } from "./library-import";
import { ToolTable } from "./tool-table";

type AnySetup = Partial<Setup> & Record<string, unknown>;

const AS_GIVEN = ""; // value of a field: what the setup says, for which the field has no option
const DEFAULT_MATERIAL = "Ti-6Al-4V";
const DEFAULT_SCALLOP = 0.01; // mm, of the service for a setup that leaves it out
const CONTROLS = ["linuxcnc", "fanuc", "haas", "siemens", "heidenhain"];
const BLANKS = [["part_offset", "Part plus margin"], ["box", "Box around the part"], ["cylinder", "Cylinder around the part"], ["step", "STEP file"]] as const;
const BLANK_KEYS = [["box", "box_mm"], ["cylinder", "cylinder_mm"], ["step", "step_file"]] as const;
const STEP_FILES = ".step,.stp,.STEP,.STP";

export class JobForm {
  readonly node: HTMLElement;
  private readonly part = el("input", { type: "file", id: "part", accept: STEP_FILES, required: true });
  private readonly order = el("input", { type: "text", id: "order", maxlength: 100, placeholder: "for example 4711, impeller" });
  private readonly material = el("select", { id: "material" }, el("option", { value: DEFAULT_MATERIAL }, DEFAULT_MATERIAL));
  private readonly scallop = el("input", { type: "number", id: "scallop", min: 0.001, max: 1, step: "any", value: 0.02 });
  private readonly stock = el("select", { id: "stock" }, ...BLANKS.map(([value, text]) => el("option", { value }, text)));
  private readonly margin = el("input", { type: "number", id: "margin", min: 0, max: 100, step: "any", value: 1 });
  private readonly blank = el("input", { type: "file", id: "blank", accept: STEP_FILES });
  private readonly blankField = field("Blank (STEP file)", this.blank);
  private readonly control = el("select", { id: "control" }, ...CONTROLS.map((d) => el("option", { value: d }, d)));
  private readonly tools = new ToolTable("toolshead", () => this.show());
  private readonly library = new LibraryImportPanel((tools, replace) => this.tools.take(tools, replace));
  private readonly setupFile = el("input", { type: "file", id: "setupfile", accept: ".json,application/json", onchange: () => void this.loadFile() });
  private readonly json = el("textarea", { id: "json", rows: 10, spellcheck: "false", class: "mono" });
  private readonly answer = el("div", { class: "answer", "aria-live": "polite" });
  private readonly send = el("button", { type: "submit", class: "main" }, "Plan and prove");
  private readonly dry = el("button", { type: "submit", value: "dry" }, "Dry check");
  private rest: Record<string, unknown> = {}; // settings without a field

  /** `onKeyless` is called where the service refuses a job for want of a key. */
  constructor(private readonly onKeyless: () => void) {
    for (const x of [this.order, this.material, this.scallop, this.stock, this.margin, this.control]) x.addEventListener("change", () => this.show());
    this.json.addEventListener("change", () => this.takeText());
    this.node = this.build();
    this.load();
    this.show();
  }

  /** Asks the service for the materials; again after a key was entered. */
  load(): void {
    void addMaterials(this.material);
  }

  private build(): HTMLElement {
    return el("form", { class: "newjob", onsubmit: (event: Event) => {
      event.preventDefault();
      void this.submit((event as SubmitEvent).submitter === this.dry);
    } },
      el("h2", {}, "New job"),
      el("div", { class: "fields" }, field("Part (STEP file)", this.part), field("Order", this.order),
        field("Material", this.material), field("Scallop height, mm", this.scallop), field("Blank", this.stock), this.blankField, field("Margin, mm", this.margin),
        field("Control", this.control)),
      el("h3", { id: "toolshead" }, "Tools"), el("p", { class: "hint" }, "Lengths are in mm from the tip upwards. Each place is cut by the stoutest tool that reaches it."),
      this.tools.node, this.library.node,
      el("details", {}, el("summary", {}, "Setup as file or text"),
        field("Setup file (JSON)", this.setupFile), field("Complete setup (JSON)", this.json, "Edits here change the fields above. Settings without a field are kept.")),
      el("p", { class: "buttons" }, this.send, this.dry), this.answer);
  }

  /** The setup as the fields and the rest say. */
  private get setup(): Record<string, unknown> {
    const { rest } = this;
    const quality = { ...(rest.quality as object | undefined), scallop_height_mm: Number(this.scallop.value) };
    const given = typeof rest.machine === "object" ? (rest.machine as { dialects?: string[] }) : {};
    // the field is the control the proof runs for, the first; the others of the setup stay
    const dialects = [this.control.value, ...(given.dialects ?? []).slice(1).filter((d) => d !== this.control.value)];
    const machine = this.control.value === AS_GIVEN ? rest.machine : { kind: "3-axis", ...given, dialects };
    const stock: Record<string, unknown> = { ...(rest.stock as object | undefined), kind: this.stock.value, margin_mm: Number(this.margin.value) };
    for (const [kind, key] of BLANK_KEYS) if (kind !== this.stock.value) delete stock[key];
    const labels: Record<string, unknown> = { ...(rest.labels as object | undefined) };
    if (this.order.value) labels.order = this.order.value;
    else delete labels.order;
    return { ...rest, tools: this.tools.value, quality, machine, stock, material: this.material.value === AS_GIVEN ? rest.material : this.material.value, labels };
  }

  /** Shows the setup as text, and the fields it needs. */
  private show(): void {
    this.blankField.hidden = this.stock.value !== "step";
    this.blank.required = !this.blankField.hidden;
    this.json.value = JSON.stringify(this.setup, null, 1);
  }

  /** Fills the fields from a setup. What the setup leaves out has the service's default, not the value of the setup before. */
  private take(setup: AnySetup): void {
    const { tools, ...rest } = setup;
    this.rest = rest;
    const quality = setup.quality as { scallop_height_mm?: number } | undefined;
    this.scallop.value = String(quality?.scallop_height_mm ?? DEFAULT_SCALLOP);
    const stock = setup.stock as { kind?: string; margin_mm?: number } | undefined;
    choose(this.stock, stock?.kind ?? "part_offset");
    this.margin.value = String(stock?.margin_mm ?? this.margin.defaultValue);
    const machine = setup.machine as { dialects?: string[] } | string | undefined;
    if (typeof machine === "string") choose(this.control, AS_GIVEN, `from ${machine}`);
    else choose(this.control, machine?.dialects?.[0] ?? "linuxcnc");
    const material = setup.material as { name?: string } | string | undefined;
    if (typeof material === "object") choose(this.material, AS_GIVEN, `${material.name ?? "custom"} (from the setup)`);
    else choose(this.material, material ?? DEFAULT_MATERIAL);
    const labels = setup.labels as { order?: string } | undefined;
    this.order.value = labels?.order ?? "";
    if (Array.isArray(tools)) this.tools.value = tools;
    this.show();
  }

  private async loadFile(): Promise<void> {
    const chosen = this.setupFile.files?.[0];
    if (!chosen) return;
    try {
      this.take(JSON.parse(await chosen.text()) as AnySetup);
      fill(this.answer, el("p", {}, `${chosen.name} is loaded into the fields.`));
    } catch {
      fill(this.answer, el("p", { role: "alert", class: "bad" }, `${chosen.name} is not valid JSON.`));
    }
  }

  private takeText(): void {
    try {
      this.take(JSON.parse(this.json.value) as AnySetup);
      this.json.removeAttribute("aria-invalid");
    } catch {
      this.json.setAttribute("aria-invalid", "true");
      fill(this.answer, el("p", { role: "alert", class: "bad" }, "The setup is not valid JSON. The fields are unchanged."));
    }
  }

  private async submit(onlyZones: boolean): Promise<void> {
    const chosen = this.part.files?.[0];
    if (!chosen) return;
    const body = new FormData();
    body.append("part", chosen, chosen.name);
    body.append("setup", new Blob([JSON.stringify(this.setup)], { type: "application/json" }), "setup.json");
    const blank = this.blank.files?.[0];
    if (this.stock.value === "step" && blank) body.append("stock", blank, blank.name);
    this.send.disabled = this.dry.disabled = true;
    fill(this.answer, el("p", {}, "Sending…"));
    try {
      const headers = { "Idempotency-Key": crypto.randomUUID?.() ?? String(Date.now()) };
      const job = (await (await ask(onlyZones ? "/v1/zones" : "/v1/jobs", { method: "POST", body, headers })).json()) as Job;
      location.assign(`/v1/jobs/${job.id}/view`);
    } catch (error) {
      showRefusal(this.answer, error);
      if (error instanceof RequestError && error.status === 401) this.onKeyless();
      this.send.disabled = this.dry.disabled = false;
    }
  }
}

/** Chooses a value, also one that the page does not know: the form changes no setup. */
function choose(select: HTMLSelectElement, value: string, words = value): void {
  const known = [...select.options].find((o) => o.value === value);
  if (known && value === AS_GIVEN) known.textContent = words;
  if (!known) select.appendChild(el("option", { value }, words));
  select.value = value;
}

/** Shows why the service refused a setup, with the name of each wrong field. */
function showRefusal(place: HTMLElement, error: unknown): void {
  const problem = error instanceof RequestError ? error.problem : {};
  const list = el("ul");
  for (const m of Array.isArray(problem.measured) ? (problem.measured as ({ at?: unknown; problem?: string } | string | null)[]) : [])
    if (m && typeof m === "object" && typeof m.at === "string") add(list, el("li", {}, el("strong", {}, m.at), ` ${m.problem ?? ""}`));
  const remedy = error instanceof RequestError && error.status === 401 ? "Enter the key under Jobs on this page, then send the job again." : problem.remedy;
  fill(place, el("div", { class: "refusal", role: "alert" }, el("h3", {}, problem.title ?? "The job was not accepted"), el("p", {}, error instanceof Error ? error.message : String(error)), list,
    remedy ? el("p", {}, el("strong", {}, "Remedy: "), remedy) : null));
}

async function addMaterials(select: HTMLSelectElement): Promise<void> {
  try {
    const found = (await (await ask("/v1/materials")).json()) as { items: { name: string }[] };
    for (const m of found.items) if (![...select.options].some((o) => o.value === m.name)) select.appendChild(el("option", { value: m.name }, m.name));
  } catch {
    // the default stays; the list of jobs says what is wrong
  }
}
