// A part and a setup without JSON: the fields most jobs need, a table of tools, and the rest as text for who wants it.
import { Refusal, ask, type Job, type Setup, type Tool } from "../shared/api";
import { add, el, field, fill } from "../shared/dom";
import { keep, kept } from "../shared/browser-storage";

type ToolRow = Partial<Record<keyof Tool, unknown>> & { id: string; kind: string; diameter_mm: number; holder?: unknown };

const KEPT = "zonemill-tools";
const AS_GIVEN = ""; // of a field: what the setup says, which the field has no word for
const HOLDER = [{ diameter_mm: 14, diameter_top_mm: 20, length_mm: 12 }, { diameter_mm: 24, diameter_top_mm: 24, length_mm: 30 }];
const FIRST: ToolRow[] = [
  { id: "T1", number: 1, kind: "flat", diameter_mm: 6, flutes: 4, flute_length_mm: 18, neck_diameter_mm: 5.8, neck_length_mm: 24, shank_diameter_mm: 6, stickout_mm: 40, holder: HOLDER },
  { id: "T2", number: 2, kind: "ball", diameter_mm: 3, flutes: 2, flute_length_mm: 9, neck_diameter_mm: 2.8, neck_length_mm: 20, shank_diameter_mm: 6, stickout_mm: 36, holder: HOLDER },
  { id: "T3", number: 3, kind: "ball", diameter_mm: 1, flutes: 2, flute_length_mm: 3, neck_diameter_mm: 0.9, neck_length_mm: 13, shank_diameter_mm: 4, stickout_mm: 29, holder: HOLDER },
];
const COLUMNS: { key: string; title: string; hint: string }[] = [
  { key: "number", title: "T", hint: "T number" }, { key: "kind", title: "Kind", hint: "Shape of the cutting end" },
  { key: "diameter_mm", title: "Ø", hint: "Diameter, mm" }, { key: "corner_radius_mm", title: "Corner", hint: "Corner radius of a bull nose, mm" },
  { key: "flutes", title: "Teeth", hint: "Number of teeth" }, { key: "flute_length_mm", title: "Flutes", hint: "Length of the flutes, mm" },
  { key: "neck_diameter_mm", title: "Neck Ø", hint: "Diameter of the neck, mm" }, { key: "neck_length_mm", title: "to shank", hint: "Tip to shank, mm" },
  { key: "shank_diameter_mm", title: "Shank Ø", hint: "Diameter of the shank, mm" }, { key: "stickout_mm", title: "Stickout", hint: "Tip to holder nose, mm" },
];

/** `onKeyless` is called where a job was refused for want of a key; `again` asks for what the form has from the service. */
export function jobForm(onKeyless: () => void): { node: HTMLElement; again: () => void } {
  let tools: (ToolRow | string)[] = keptTools();
  let rest: Record<string, unknown> = {};
  const part = el("input", { type: "file", id: "part", accept: ".step,.stp,.STEP,.STP", required: true });
  const order = el("input", { type: "text", id: "order", maxlength: 100, placeholder: "for example 4711, impeller" });
  const material = el("select", { id: "material" }, el("option", { value: "Ti-6Al-4V" }, "Ti-6Al-4V"));
  const scallop = el("input", { type: "number", id: "scallop", min: 0.001, max: 1, step: "any", value: 0.02 });
  const stock = el("select", { id: "stock" }, el("option", { value: "part_offset" }, "the part grown by a margin"), el("option", { value: "box" }, "a box round the part"), el("option", { value: "cylinder" }, "a bar round the part"), el("option", { value: "step" }, "a STEP file"));
  const margin = el("input", { type: "number", id: "margin", min: 0, max: 100, step: "any", value: 1 });
  const blank = el("input", { type: "file", id: "blank", accept: ".step,.stp,.STEP,.STP" });
  const blankField = field("Blank, a STEP file", blank);
  const control = el("select", { id: "control" }, ...["linuxcnc", "fanuc", "haas", "siemens", "heidenhain"].map((d) => el("option", { value: d }, d)));
  const table = el("div", { class: "tools" });
  const json = el("textarea", { id: "json", rows: 10, spellcheck: "false", class: "mono" });
  const answer = el("div", { class: "answer", "aria-live": "polite" });
  const send = el("button", { type: "submit", class: "main" }, "Plan and prove");
  const dry = el("button", { type: "submit", value: "dry" }, "Dry check");

  const setup = (): Record<string, unknown> => {
    const quality = { ...(rest.quality as object | undefined), scallop_height_mm: Number(scallop.value) };
    const given = typeof rest.machine === "object" ? (rest.machine as { dialects?: string[] }) : {};
    // the field is the control the proof runs for, the first; others of the setup stay
    const dialects = [control.value, ...(given.dialects ?? []).slice(1).filter((d) => d !== control.value)];
    const machine = control.value === AS_GIVEN ? rest.machine : { kind: "3-axis", ...given, dialects };
    const start: Record<string, unknown> = { ...(rest.stock as object | undefined), kind: stock.value, margin_mm: Number(margin.value) };
    for (const [kind, key] of [["box", "box_mm"], ["cylinder", "cylinder_mm"], ["step", "step_file"]] as const) if (kind !== stock.value) delete start[key];
    const labels: Record<string, unknown> = { ...(rest.labels as object | undefined) };
    if (order.value) labels.order = order.value;
    else delete labels.order;
    return { ...rest, tools: tools.map(clean), quality, machine, stock: start, material: material.value === AS_GIVEN ? rest.material : material.value, labels };
  };
  const show = (): void => {
    blankField.hidden = stock.value !== "step";
    blank.required = !blankField.hidden;
    json.value = JSON.stringify(setup(), null, 1);
  };
  /** `focus`: what has it afterwards, for the table is made anew. */
  const drawTools = (focus?: string): void => {
    fill(table, toolTable(tools, () => {
      keepTools(tools);
      show();
    }, drawTools));
    if (focus) table.querySelector<HTMLElement>(focus)?.focus();
    show();
  };
  const take = (s: Partial<Setup> & Record<string, unknown>): void => {
    const { tools: t, ...others } = s;
    if (Array.isArray(t)) tools = t as unknown as (ToolRow | string)[];
    rest = others;
    // what a setup leaves out is as the service takes it, not as the job before had it
    const q = s.quality as { scallop_height_mm?: number } | undefined;
    scallop.value = String(q?.scallop_height_mm ?? 0.01);
    const b = s.stock as { kind?: string; margin_mm?: number } | undefined;
    choose(stock, b?.kind ?? "part_offset");
    margin.value = String(b?.margin_mm ?? margin.defaultValue);
    const m = s.machine as { dialects?: string[] } | string | undefined;
    if (typeof m === "string") choose(control, AS_GIVEN, `of ${m}`);
    else choose(control, m?.dialects?.[0] ?? "linuxcnc");
    const material_ = s.material as { name?: string } | string | undefined;
    if (typeof material_ === "object") choose(material, AS_GIVEN, `${material_.name ?? "its own"}, of the setup`);
    else choose(material, material_ ?? "Ti-6Al-4V");
    const l = s.labels as { order?: string } | undefined;
    order.value = l?.order ?? "";
    drawTools();
  };
  const file = el("input", { type: "file", id: "setupfile", accept: ".json,application/json", onchange: async () => {
    const chosen = file.files?.[0];
    if (!chosen) return;
    try {
      take(JSON.parse(await chosen.text()) as Record<string, unknown>);
      fill(answer, el("p", {}, `${chosen.name} is in the fields.`));
    } catch {
      fill(answer, el("p", { role: "alert", class: "bad" }, `${chosen.name} is no JSON.`));
    }
  } });
  json.addEventListener("change", () => {
    try {
      take(JSON.parse(json.value) as Record<string, unknown>);
      json.removeAttribute("aria-invalid");
    } catch {
      json.setAttribute("aria-invalid", "true");
      fill(answer, el("p", { role: "alert", class: "bad" }, "The setup below is no JSON, so the fields are as they were."));
    }
  });
  for (const x of [order, material, scallop, stock, margin, control]) x.addEventListener("change", show);
  void materials(material);
  drawTools();

  const form = el("form", { class: "newjob", onsubmit: (event: Event) => {
    event.preventDefault();
    void submit((event as SubmitEvent).submitter === dry);
  } },
    el("h2", {}, "New job"),
    el("div", { class: "fields" }, field("Part, a STEP file", part), field("Order", order),
      field("Material", material), field("Height of scallops, mm", scallop), field("Blank", stock), blankField, field("Margin, mm", margin),
      field("Control", control)),
    el("h3", { id: "toolshead" }, "Tools"), el("p", { class: "hint" }, "Lengths in mm from the tip upwards. The stoutest tool that reaches a place is taken for it."), table,
    el("details", {}, el("summary", {}, "A setup from a file, or as text"),
      field("Setup, JSON", file), field("All of the setup", json, "What is written here goes into the fields; what has no field stays as it stands here.")),
    el("p", { class: "buttons" }, send, dry), answer);

  async function submit(onlyZones: boolean): Promise<void> {
    const chosen = part.files?.[0];
    if (!chosen) return;
    const body = new FormData();
    body.append("part", chosen, chosen.name);
    body.append("setup", new Blob([JSON.stringify(setup())], { type: "application/json" }), "setup.json");
    const start = blank.files?.[0];
    if (stock.value === "step" && start) body.append("stock", start, start.name);
    send.disabled = dry.disabled = true;
    fill(answer, el("p", {}, "Sending…"));
    try {
      const job = (await (await ask(onlyZones ? "/v1/zones" : "/v1/jobs", { method: "POST", body, headers: { "Idempotency-Key": crypto.randomUUID?.() ?? String(Date.now()) } })).json()) as Job;
      location.assign(`/v1/jobs/${job.id}/view`);
    } catch (error) {
      refuse(answer, error);
      if (error instanceof Refusal && error.status === 401) onKeyless();
      send.disabled = dry.disabled = false;
    }
  }
  return { node: form, again: () => void materials(material) };
}

/** Chooses a value, one the page does not know too: what a setup asks for is not changed on its way. */
function choose(select: HTMLSelectElement, value: string, words = value): void {
  const known = [...select.options].find((o) => o.value === value);
  if (known) known.textContent = value === AS_GIVEN ? words : known.textContent;
  else select.appendChild(el("option", { value }, words));
  select.value = value;
}

/** What is wrong with a setup, each with the field it is about. */
function refuse(place: HTMLElement, error: unknown): void {
  const problem = error instanceof Refusal ? error.problem : {};
  const list = el("ul");
  if (Array.isArray(problem.measured))
    for (const m of problem.measured as ({ at?: unknown; problem?: string } | string | null)[]) if (m && typeof m === "object" && typeof m.at === "string") add(list, el("li", {}, el("strong", {}, m.at), ` ${m.problem ?? ""}`));
  const remedy = error instanceof Refusal && error.status === 401 ? "give the key under Jobs on this page, and send once more" : problem.remedy;
  fill(place, el("div", { class: "refusal", role: "alert" }, el("h3", {}, problem.title ?? "The job was not taken"), el("p", {}, error instanceof Error ? error.message : String(error)), list,
    remedy ? el("p", {}, el("strong", {}, "What to do: "), remedy) : null));
}

async function materials(select: HTMLSelectElement): Promise<void> {
  try {
    const found = (await (await ask("/v1/materials")).json()) as { items: { name: string }[] };
    for (const m of found.items) if (![...select.options].some((o) => o.value === m.name)) select.appendChild(el("option", { value: m.name }, m.name));
  } catch {
    // the built-in default stays; the list of jobs says what is wrong
  }
}

function toolTable(tools: (ToolRow | string)[], changed: () => void, redraw: (focus: string) => void): HTMLElement {
  const body = el("tbody");
  const remove = (i: number): HTMLElement => el("td", {}, el("button", { type: "button", "aria-label": `Remove tool ${i + 1}`, onclick: () => {
    tools.splice(i, 1);
    redraw(tools.length ? `[aria-label="Remove tool ${Math.min(i + 1, tools.length)}"]` : ".add");
    changed();
  } }, "✕"));
  tools.forEach((t, i) => {
    if (typeof t === "string") {
      add(body, el("tr", {}, el("td", { colspan: COLUMNS.length + 1, class: "shelf" }, t, " ", el("span", { class: "hint" }, "of the library")), remove(i)));
      return;
    }
    const row = el("tr");
    for (const c of COLUMNS) {
      const label = `${c.hint}, tool ${i + 1}`;
      const value = (t as Record<string, unknown>)[c.key];
      const input = c.key === "kind"
        ? el("select", { "aria-label": label }, ...["flat", "ball", "bull"].map((k) => el("option", { value: k, selected: k === t.kind }, k)))
        : el("input", { type: "number", "aria-label": label, min: 0, step: "any", value: typeof value === "number" ? value : "" });
      input.addEventListener("change", () => {
        if (c.key === "kind") t.kind = input.value;
        else if (input.value === "") delete (t as Record<string, unknown>)[c.key];
        else (t as Record<string, unknown>)[c.key] = Number(input.value);
        if (c.key === "number") t.id = `T${input.value || i + 1}`;
        changed();
      });
      add(row, el("td", { "data-title": c.title }, input));
    }
    const own = Array.isArray(t.holder) && t.holder.length ? t.holder : HOLDER;
    const holder = el("input", { type: "checkbox", "aria-label": `Holder, tool ${i + 1}`, checked: Array.isArray(t.holder) && t.holder.length > 0 });
    holder.addEventListener("change", () => {
      t.holder = holder.checked ? structuredClone(own) : [];
      changed();
    });
    add(row, el("td", { "data-title": "Holder" }, holder));
    add(row, remove(i));
    add(body, row);
  });
  return el("div", {}, el("table", { "aria-labelledby": "toolshead" }, el("thead", {}, el("tr", {}, ...COLUMNS.map((c) => el("th", { scope: "col", title: c.hint }, c.title)), el("th", { scope: "col", title: "A holder of 14 to 24 mm, or the one of the setup" }, "Holder"), el("th", { scope: "col" }, el("span", { class: "sr" }, "Remove")))), body),
    el("p", { class: "buttons" },
      el("button", { type: "button", class: "add", onclick: () => {
        const own = tools.filter((t) => typeof t !== "string");
        const last = own[own.length - 1] ?? FIRST[0]!;
        const number = Math.max(0, ...own.map((t) => Number(t.number ?? 0))) + 1;
        tools.push({ ...structuredClone(last), id: `T${number}`, number });
        redraw(`[aria-label="T number, tool ${tools.length}"]`);
        changed();
      } }, "Add a tool like the last"),
      el("button", { type: "button", class: "anew", onclick: () => {
        tools.splice(0, tools.length, ...structuredClone(FIRST));
        redraw(".anew");
        changed();
      } }, "The first three again")));
}

/** A tool as the setup takes it: without what its kind does not have. */
function clean(t: ToolRow | string): ToolRow | string {
  if (typeof t === "string") return t;
  const out = { ...t };
  if (out.kind !== "bull") delete out.corner_radius_mm;
  return out;
}

function keptTools(): (ToolRow | string)[] {
  try {
    const found = JSON.parse(kept("localStorage", KEPT) ?? "null") as (ToolRow | string)[] | null;
    if (Array.isArray(found) && found.length) return found;
  } catch {
    // what was kept cannot be read: begin anew
  }
  return structuredClone(FIRST);
}

function keepTools(tools: (ToolRow | string)[]): void {
  keep("localStorage", KEPT, JSON.stringify(tools));
}
