// A job that has ended: the picture, and beside it all that belongs to it.
import { Vector3 } from "three";
import { ask, type Job, type JobFiles } from "../shared/api";
import { css, toolColour, zoneColour } from "../scene/colours";
import { add, duration, el, figure, fill, percent, swatch } from "../shared/dom";
import { colourOf, onTheme, reducedMotion } from "../shared/page-frame";
import { legendOf } from "./legend";
import { lookOf, type Look } from "./view-link";
import { Picture, type Mode, type P3, type Place } from "../scene/scene";
import type { ViewFinding, ViewHead } from "../shared/view-file";
import { fileList, keyTable, needs, slender, toolWords, whereOf } from "../shared/wording";

/** Findings of the report, those it counts only included. */
function foundIn(h: ViewHead): number {
  return Math.max(h.findings.length, Object.values(h.found ?? {}).reduce((sum, n) => sum + n, 0));
}

function mindedIn(h: ViewHead): number {
  return (h.cautions?.length ?? 0) + (h.notes?.length ?? 0);
}

export class JobView {
  readonly nodes: HTMLElement[];
  readonly picture: Picture;
  private head: ViewHead | null = null;
  private stage = el("div", { class: "stage" });
  private names = el("div", { class: "names", "aria-hidden": "true" });
  private ring = el("div", { class: "ring", hidden: true, "aria-hidden": "true" });
  private status = el("p", { class: "status", role: "status" });
  private busy = el("p", { class: "busy" }, "Loading…");
  private panel = el("aside", { class: "panel", "aria-label": "What is shown" });
  private bar = el("div", { class: "timebar" });
  private legend = el("div", { class: "legend" });
  private slider = el("input", { type: "range", min: 0, max: 1000, value: 1000, step: 1, "aria-label": "Time of machining" });
  private clock = el("output", { class: "clock", "aria-live": "off" }); // the slider says the same
  private play = el("button", { type: "button", class: "play", "aria-label": "Play" }, "▶");
  private speed = el("select", { "aria-label": "Speed of playing" });
  private modes: Record<Mode, HTMLInputElement>;
  private stepBoxes: HTMLInputElement[] = [];
  private rapids = el("input", { type: "checkbox", id: "rapids" });
  private holder = el("input", { type: "checkbox", id: "holder", checked: true });
  private stock = el("input", { type: "checkbox", id: "stock", checked: true });
  private measure = el("button", { type: "button", "aria-pressed": "false", onclick: () => this.setMeasuring(!this.measuring) }, "Measure");
  private measuring = false;
  private ruler: Vector3[] = [];
  private sectionAxis = el("select", { id: "saxis" });
  private sectionPlace = el("input", { type: "range", min: 0, max: 1000, value: 500, "aria-label": "Place of the section" });
  private sectionFlip = el("input", { type: "checkbox", id: "sflip" });
  private findingButtons: HTMLButtonElement[] = [];
  private chosen = -1;
  private marked: Vector3 | null = null;
  private seconds: number | null = null;
  private stockShown = false;
  private playing = 0;
  private labels: { node: HTMLElement; place: Vector3 }[] = [];
  private program: { name: string; lines: string[] } | null = null;
  private lineWanted = { name: "", line: 0 };
  private programBox = el("pre", { class: "program", tabindex: 0, role: "group", "aria-label": "Lines of the program at this time", hidden: true });
  private freeTimer = 0;
  private look: Look;
  private ready = false;
  private written = 0; // when the address was
  private writing = 0;

  constructor(private job: Job, private files: JobFiles) {
    this.picture = new Picture(this.stage);
    this.look = lookOf(location.hash);
    const canvas = this.picture.canvas;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", "The part. Arrow keys turn it, shift and arrows move it, plus and minus come nearer, Enter says what is under the cross, F shows all of it, question mark lists the keys.");
    add(this.stage, el("div", { class: "aim", "aria-hidden": "true" }), this.names, this.ring, this.busy, this.legend, this.toolButtons());
    this.modes = { zones: this.radio("zones"), walls: this.radio("walls"), deviation: this.radio("deviation") };
    this.nodes = [el("div", { class: "left" }, this.stage, this.status, this.bar), this.programBox, this.panel];
    canvas.addEventListener("keydown", (e) => this.key(e));
    let down: { x: number; y: number } | null = null;
    canvas.addEventListener("pointerdown", (e) => (down = { x: e.clientX, y: e.clientY }));
    canvas.addEventListener("pointerup", (e) => {
      if (down && Math.hypot(e.clientX - down.x, e.clientY - down.y) < 6) this.click(e.clientX, e.clientY);
      down = null;
    });
    this.picture.onDraw = () => this.placeNames();
    this.picture.onMove = () => this.remember();
    onTheme(() => this.paint());
    // a link to another look of the same job changes the address alone
    addEventListener("hashchange", () => {
      const look = lookOf(location.hash);
      if (this.ready && look.c && this.stage.isConnected) this.take(look);
    });
  }

  start(): void {
    this.paint();
  }

  private paint(): void {
    this.picture.theme(colourOf("--stage"), colourOf("--ink"));
  }

  private radio(mode: Mode): HTMLInputElement {
    return el("input", { type: "radio", name: "mode", id: `mode-${mode}`, value: mode, onchange: () => this.setMode(mode) });
  }

  private toolButtons(): HTMLElement {
    const to = (d: P3): (() => void) => () => {
      this.picture.fit(d);
      this.remember();
    };
    const b = (text: string, label: string, f: () => void): HTMLElement => el("button", { type: "button", "aria-label": label, title: label, onclick: f }, text);
    return el("div", { class: "viewbuttons", role: "group", "aria-label": "From where one looks" },
      b("All", "All of the part", to([-0.55, -0.95, 0.9])), b("Top", "Top view", to([0, -0.001, 1])),
      b("Front", "Front view", to([0, -1, 0.02])), b("Side", "Side view, from the right", to([1, 0, 0.02])));
  }

  begin(h: ViewHead): void {
    this.head = h;
    this.picture.begin(h);
    this.buildPanel(h);
    this.buildBar(h);
    for (const [list, kind] of [[h.walls, "wall"], [h.connections, "connection"]] as const)
      for (const w of list.slice(0, 40))
        if (w.at_mm) {
          const node = el("span", { class: `name ${kind}` }, w.id);
          this.names.appendChild(node);
          this.labels.push({ node, place: new Vector3(...w.at_mm) });
        }
    const bad = h.state === "unproved" && h.findings.length > 0;
    this.setMode(bad || h.kind === "verify" ? "deviation" : "zones");
    this.picture.fit();
    this.show(this.look);
    this.say(this.summary(h));
  }

  /** Colours, camera, section and steps of a look; what it does not name stays. */
  private show(look: Look): void {
    if (look.m) this.setMode(look.m);
    if (look.c) this.picture.pose = look.c;
    if (look.s) {
      this.sectionAxis.value = String(look.s[0]);
      this.sectionPlace.value = String(Math.round(1000 * look.s[1]));
      this.sectionFlip.checked = look.s[2] === 1;
      this.cut();
    }
    if (look.p !== undefined) {
      const wanted = new Set(look.p.split(".").filter(Boolean).map(Number));
      this.stepBoxes.forEach((box, i) => (box.checked = wanted.has(i)));
    }
    this.showSteps();
  }

  /** All of a look, with what it leaves out put away. */
  private take(look: Look): void {
    this.sectionAxis.value = "";
    this.cut();
    this.show({ p: "", ...look });
    this.setTime(look.t ?? null);
  }

  private summary(h: ViewHead): string {
    const count = foundIn(h);
    const found = `${count} ${count === 1 ? "finding" : "findings"}`;
    if (h.findings.length) return `${found}${h.withheld ? ": the program is not handed out" : " in this program"}. Choose one in the list to go there.`;
    const minded = mindedIn(h) ? ` ${mindedIn(h) === 1 ? "One thing is" : `${mindedIn(h)} things are`} to be minded, see the list.` : "";
    if (h.kind === "verify") return `Nothing was found. The map shows what the program leaves on the part.${minded}`;
    if (!h.remainder.length) return `Proved and complete.${minded}`;
    return `${h.remainder.some((r) => r.tool_at_hand) ? "Proved. What is hatched red stays, and the list says why." : "Proved. What is hatched red stays: no tool of the setup gets there, and the list says why."}${minded}`;
  }

  roughDone(ms: number): void {
    this.nodes[0]!.dataset.rough = String(Math.round(ms));
    this.busy.textContent = "Getting finer…";
  }

  finish(bytes: number, ms: number): void {
    this.picture.settle();
    this.busy.remove();
    const left = this.nodes[0]!;
    left.dataset.bytes = String(bytes);
    left.dataset.ready = String(Math.round(ms));
    this.ready = true;
    if (this.look.t !== undefined) this.setTime(this.look.t);
    this.remember();
    (window as unknown as { zonemill: unknown }).zonemill = { picture: this.picture, frame: () => this.picture.timed(), moving: () => this.picture.timedMoving() };
  }

  // --- the panel ------------------------------------------------------------------------------------------------------

  private section(title: string, open: boolean, ...children: (Node | string | null)[]): HTMLElement {
    return el("details", open ? { open: true } : {}, el("summary", {}, el("h2", {}, title)), ...children);
  }

  private buildPanel(h: ViewHead): void {
    const facts = el("dl", { class: "facts" });
    const fact = (name: string, value: string): void => add(facts, el("div", {}, el("dt", {}, name), el("dd", {}, value)));
    fact("covered", percent(h.facts.coverage));
    if (h.kind === "plan") fact("of what is in reach", percent(h.facts.reach_coverage));
    fact("machining", duration(h.facts.machining_time_s ?? h.seconds));
    fact("deepest cut into the part", figure(h.facts.gouge_max_mm, 3, "mm"));
    if (h.budget_mm.allowance) fact("to stay on it, and not counted", figure(h.budget_mm.allowance, 3, "mm"));
    fact("allowed", `${figure(h.budget_mm.scallop, 3)} high, ${figure(h.budget_mm.gouge, 3, "mm")} deep`);
    const colours = el("fieldset", { class: "modes" }, el("legend", {}, "Colours"),
      ...(Object.entries(this.modes) as [Mode, HTMLInputElement][])
        .filter(([m]) => h.kind === "plan" || m !== "zones")
        .map(([m, input]) => el("span", {}, input, el("label", { for: input.id }, { zones: "Zones", walls: "Walls", deviation: "Deviation" }[m]))));
    fill(this.panel, facts, colours,
      h.findings.length ? this.section(`Findings (${foundIn(h)})`, true, this.findingList(h)) : null,
      mindedIn(h) ? this.section(`To be minded (${mindedIn(h)})`, false, this.mindedList(h)) : null,
      h.zones.length ? this.section(`Zones (${h.zones.length})`, !h.findings.length && innerWidth > 700, this.zoneList(h)) : null,
      h.remainder.length ? this.section(`What stays (${h.remainder.length})`, !h.findings.length, this.restList(h)) : null,
      h.steps.length ? this.section(`Tool paths (${h.steps.length})`, this.look.p !== undefined, this.stepList(h)) : null,
      this.section("Section and measuring", false, this.sectionTools()),
      this.section("Files", false, fileList(this.files), this.files.withheld ? el("p", { class: "hint" }, this.files.withheld.split("; first finding")[0]! + ".") : null),
      this.section("Share and keys", false, this.sharing(), keyTable()));
    void this.job;
  }

  private findingList(h: ViewHead): HTMLElement {
    const list = el("ol", { class: "findings" });
    h.findings.forEach((f, i) => {
      const button = el("button", { type: "button", "aria-pressed": "false", onclick: () => this.choose(i) },
        el("strong", {}, f.kind), " ", f.message, " ",
        f.line ? el("span", { class: "where" }, `${f.program} line ${f.line}`) : null);
      this.findingButtons.push(button);
      add(list, el("li", {}, button));
    });
    const more = foundIn(h) - h.findings.length;
    if (more > 0) add(list, el("li", { class: "hint" }, `and ${more} more, which are counted only: ${Object.entries(h.found!).map(([kind, n]) => `${n} ${kind}`).join(", ")} in all`));
    return list;
  }

  private mindedList(h: ViewHead): HTMLElement {
    const list = el("ul", { class: "minded" });
    for (const c of h.cautions ?? [])
      add(list, el("li", {}, el("strong", {}, c.kind.replace(/_/g, " ")), ` ${c.message}; ${c.remedy} `,
        c.at_mm ? el("button", { type: "button", class: "link", onclick: () => this.goTo(c.at_mm!, Math.max(0.12 * this.picture.size, 3), null) }, "where") : null));
    for (const note of h.notes ?? []) add(list, el("li", {}, note));
    return list;
  }

  private zoneList(h: ViewHead): HTMLElement {
    const list = el("ul", { class: "rows" });
    h.zones.forEach((z, i) => {
      const label = h.labelled.findIndex((x) => x.zone === z.id);
      add(list, el("li", {}, el("button", { type: "button", "aria-pressed": "false", onclick: (e: Event) => this.pressOne(e, list, [label]) },
        swatch(css(zoneColour(i))), el("strong", {}, z.id), ` ${z.strategy}, ${z.tool}`,
        el("span", { class: "where" }, `${figure(z.area_mm2, 0, "mm²")}${z.scallop_mm?.p99 !== null && z.scallop_mm?.p99 !== undefined ? `, scallop ${figure(z.scallop_mm.p99, 3, "mm")}` : ""}`))));
    });
    return list;
  }

  private restList(h: ViewHead): HTMLElement {
    const list = el("ul", { class: "rows" });
    const by = new Map<string, { rows: number[]; area: number; need: string }>();
    h.remainder.forEach((r, i) => {
      const key = `${r.reason}|${needs(r)}`;
      const group = by.get(key) ?? { rows: [], area: 0, need: needs(r) };
      group.rows.push(i);
      group.area += r.area_mm2;
      by.set(key, group);
    });
    for (const [key, g] of [...by].sort((a, b) => b[1].area - a[1].area)) {
      const labels = g.rows.map((k) => h.labelled.findIndex((x) => x.remainder === k));
      const reason = key.split("|")[0]!;
      add(list, el("li", {}, el("button", { type: "button", "aria-pressed": "false", onclick: (e: Event) => {
        if (this.pressOne(e, list, labels)) this.goTo(h.remainder[g.rows[0]!]!.at_mm, Math.max(0.12 * this.picture.size, 3), null);
      } }, swatch("#d8191f", true), el("strong", {}, reason), ` ${[g.need, slender(g.rows.map((k) => h.remainder[k]!))].filter(Boolean).join(", ")}`,
        el("span", { class: "where" }, `${figure(g.area, g.area < 1 ? 2 : g.area < 10 ? 1 : 0, "mm²")}${g.rows.length > 1 ? `, ${g.rows.length} places` : ""}`))));
    }
    return list;
  }

  /** Presses one button of a list and lets its labels stand out; returns whether it is pressed now. */
  private pressOne(event: Event, list: HTMLElement, labels: number[]): boolean {
    const button = event.currentTarget as HTMLElement;
    const on = button.getAttribute("aria-pressed") !== "true";
    for (const other of this.panel.querySelectorAll(".rows button")) other.setAttribute("aria-pressed", "false");
    button.setAttribute("aria-pressed", String(on));
    this.picture.highlight(on ? new Set(labels) : null);
    void list;
    return on;
  }

  private stepList(h: ViewHead): HTMLElement {
    const tools = h.tools.map((t) => t.number);
    const rows: HTMLElement[] = [];
    const operations = [...new Set(h.steps.map((s) => s.operation))];
    for (const operation of operations) {
      const mine = h.steps.map((s, i) => ({ s, i })).filter((x) => x.s.operation === operation);
      const all = el("input", { type: "checkbox", id: `op-${operation}`, onchange: () => {
        mine.forEach(({ i }) => (this.stepBoxes[i]!.checked = all.checked));
        this.showSteps();
      } });
      const list = el("ul", { class: "rows steps" });
      for (const { s, i } of mine) {
        const box = el("input", { type: "checkbox", id: `step-${i}`, onchange: () => this.showSteps() });
        this.stepBoxes[i] = box;
        add(list, el("li", {}, box, el("label", { for: box.id }, swatch(css(toolColour(Math.max(0, tools.indexOf(s.tool))))),
          el("strong", {}, s.id), ` ${[s.zone ?? (operation ? "several zones" : ""), s.strategy, operation ? `T${s.tool}` : toolWords(h, s.tool)].filter(Boolean).join(", ")}`),
          el("button", { type: "button", class: "link where", "aria-label": `${duration(s.end_s - s.start_s)}, go to the start of ${s.id}`, onclick: () => this.setTime(s.start_s, true) }, duration(s.end_s - s.start_s))));
      }
      rows.push(el("div", { class: "operation" }, all, el("label", { for: all.id }, el("strong", {}, operation || "Program"), ` (${mine.length})`)), list);
    }
    this.rapids.addEventListener("change", () => this.showSteps());
    this.holder.addEventListener("change", () => {
      this.picture.showHolder(this.holder.checked);
      if (this.seconds !== null) this.setTime(this.seconds);
    });
    return el("div", {}, el("p", { class: "inline" }, this.rapids, el("label", { for: "rapids" }, "Rapids, dashed"), this.holder, el("label", { for: "holder" }, "Holder")),
      h.withheld ? el("p", { class: "hint" }, `The job is not proved: its way is drawn on a grid of ${h.path_grid_mm} mm, as a picture, and its program is not handed out.`) : null, ...rows);
  }

  private sectionTools(): HTMLElement {
    for (const [value, text] of [["", "No section"], ["0", "Across X"], ["1", "Across Y"], ["2", "Across Z"]] as const) this.sectionAxis.appendChild(el("option", { value }, text));
    this.sectionAxis.value = "";
    this.sectionAxis.addEventListener("input", () => {
      // what stands between the viewer and the plane goes
      if (this.sectionAxis.value !== "") this.sectionFlip.checked = this.picture.camera.position.getComponent(Number(this.sectionAxis.value)) < this.picture.middle.getComponent(Number(this.sectionAxis.value));
    });
    for (const x of [this.sectionAxis, this.sectionPlace, this.sectionFlip]) x.addEventListener("input", () => this.cut());
    return el("div", { class: "sectiontools" }, el("label", { for: "saxis" }, "Section"), this.sectionAxis, this.sectionPlace,
      el("span", {}, this.sectionFlip, el("label", { for: "sflip" }, "The other side")),
      el("p", {}, this.measure, " ", el("span", { class: "hint" }, "then two places of the part")));
  }

  private cut(): void {
    const axis = this.sectionAxis.value === "" ? null : (Number(this.sectionAxis.value) as 0 | 1 | 2);
    this.picture.cutAway(axis, Number(this.sectionPlace.value) / 1000, this.sectionFlip.checked);
    if (axis !== null && this.head) {
      const [low, high] = this.head.bounds_mm;
      const at = low[axis] + (Number(this.sectionPlace.value) / 1000) * (high[axis] - low[axis]);
      this.sectionPlace.setAttribute("aria-valuetext", `${at.toFixed(2)} mm`);
      this.say(`Section at ${"XYZ"[axis]} ${at.toFixed(2)} mm`);
    }
    this.remember();
  }

  private sharing(): HTMLElement {
    return el("p", {}, el("button", { type: "button", onclick: () => {
      this.write();
      // a browser has a clipboard only over https and on this machine
      const copied = navigator.clipboard ? navigator.clipboard.writeText(location.href) : Promise.reject(new Error("no clipboard"));
      copied.then(() => this.say("The link is copied. It opens this job with this look."),
        () => this.say("The browser lets no page copy here. The address of this page is the link."));
    } }, "Copy link"), " ", el("button", { type: "button", onclick: () => {
      const a = el("a", { href: this.picture.png(), download: `${this.job.id}.png` });
      a.click();
    } }, "Save picture"));
  }

  // --- colours and steps --------------------------------------------------------------------------------------------------

  private get mode(): Mode {
    return (Object.entries(this.modes) as [Mode, HTMLInputElement][]).find(([, i]) => i.checked)?.[0] ?? "zones";
  }

  private setMode(mode: Mode): void {
    if (mode === "zones" && this.head?.kind === "verify") return; // it has none
    this.modes[mode].checked = true;
    this.picture.setMode(mode);
    this.names.hidden = mode === "deviation";
    this.buildLegend(mode);
    this.remember();
  }

  private buildLegend(mode: Mode): void {
    const h = this.head;
    if (!h) return;
    fill(this.legend, ...legendOf(h, mode, new Set([...this.shown()].map((i) => h.steps[i]!.tool)), this.stockShown));
    this.picture.above(this.legend.offsetHeight);
    this.stage.style.setProperty("--covered", `${this.legend.offsetHeight}px`);
  }

  private shown(): Set<number> {
    return new Set(this.stepBoxes.flatMap((box, i) => (box?.checked ? [i] : [])));
  }

  private showSteps(): void {
    const steps = this.shown();
    this.picture.show(steps, this.rapids.checked);
    for (const all of this.panel.querySelectorAll<HTMLInputElement>("[id^=op-]")) {
      const boxes = [...(all.closest(".operation")!.nextElementSibling!.querySelectorAll<HTMLInputElement>("input"))];
      all.checked = boxes.every((b) => b.checked);
      all.indeterminate = !all.checked && boxes.some((b) => b.checked);
    }
    this.buildLegend(this.mode);
    this.remember();
  }

  // --- time -------------------------------------------------------------------------------------------------------------

  private buildBar(h: ViewHead): void {
    if (!h.steps.length || !h.seconds) {
      this.bar.hidden = true;
      return;
    }
    this.slider.max = String(Math.ceil(h.seconds * 10));
    this.slider.value = this.slider.max;
    this.slider.addEventListener("input", () => this.setTime(Number(this.slider.value) / 10));
    this.play.addEventListener("click", () => this.toggle());
    for (const [value, text] of [["1", "1×"], ["10", "10×"], ["60", "60×"], ["300", "300×"]] as const) this.speed.appendChild(el("option", { value }, text));
    this.speed.value = "60";
    const jump = (by: number): void => {
      const now = this.seconds ?? h.seconds;
      const starts = h.steps.map((s) => s.start_s);
      const next = by > 0 ? starts.find((t) => t > now + 0.05) : [...starts].reverse().find((t) => t < now - 0.5);
      this.setTime(next ?? (by > 0 ? h.seconds : 0), true);
    };
    this.stock.addEventListener("change", () => {
      this.picture.showStock(this.stock.checked);
      this.setTime(this.seconds ?? h.seconds);
    });
    fill(this.bar, this.play,
      el("button", { type: "button", "aria-label": "Step before", onclick: () => jump(-1) }, "«"),
      el("button", { type: "button", "aria-label": "Next step", onclick: () => jump(1) }, "»"),
      this.slider, this.speed,
      el("button", { type: "button", "aria-label": "Put the tool away", title: "Put the tool away", onclick: () => this.setTime(null) }, "✕"),
      this.picture.hasStock ? el("span", { class: "stockbox" }, this.stock, el("label", { for: "stock" }, "Stock")) : null, this.clock);
    this.tell(null);
  }

  private setTime(seconds: number | null, ensure = false, known: Place | null = null): void {
    const h = this.head!;
    this.seconds = seconds === null ? null : Math.min(h.seconds, Math.max(0, seconds));
    if (this.seconds !== null) {
      const box = this.stepBoxes[(known ?? this.picture.at(this.seconds))?.step ?? -1];
      if (box && !box.checked && (ensure || this.shown().size === 0 || this.playing)) {
        box.checked = true;
        this.showSteps();
      }
    }
    const here = this.picture.time(this.seconds, known);
    const stock = here !== null && this.stock.checked && this.picture.hasStock;
    if (stock !== this.stockShown) {
      this.stockShown = stock;
      this.buildLegend(this.mode);
    }
    this.slider.value = String(Math.round((this.seconds ?? h.seconds) * 10));
    this.tell(here);
    this.remember();
  }

  private tell(here: Place | null): void {
    const h = this.head!;
    if (!here || this.seconds === null) {
      this.clock.textContent = `${duration(h.seconds)} in all; move the slider to see the tool`;
      this.slider.setAttribute("aria-valuetext", "no tool shown");
      this.programBox.hidden = true;
      return;
    }
    const s = h.steps[here.step]!;
    const p = here.place;
    const words = `${duration(this.seconds)} of ${duration(h.seconds)} · ${[s.id === `T${s.tool}` ? "" : s.id, s.zone ?? "", s.strategy, `T${s.tool}`].filter(Boolean).join(" ")} · X ${p.x.toFixed(2)} Y ${p.y.toFixed(2)} Z ${p.z.toFixed(2)}${here.line ? ` · line ${here.line}` : ""}`;
    this.clock.textContent = words;
    this.slider.setAttribute("aria-valuetext", words);
    if (here.line) void this.showProgram(s.program, here.line);
  }

  /** The lines of the program round the one that runs, where the job hands its program out. */
  private async showProgram(name: string, line: number): Promise<void> {
    const file = this.files.items.find((f) => f.name === name);
    if (!file) {
      this.programBox.hidden = true;
      return;
    }
    this.lineWanted = { name, line };
    if (this.program?.name !== name) {
      const program = (this.program = { name, lines: [] as string[] });
      this.programBox.hidden = true;
      try {
        program.lines = (await (await ask(file.href)).text()).split("\n");
      } catch {
        if (this.program === program) this.program = null; // the next move of the slider asks again
        return;
      }
      // the slider may have gone on meanwhile
      if (this.program === program && this.seconds !== null) void this.showProgram(this.lineWanted.name, this.lineWanted.line);
      return;
    }
    const lines = this.program.lines;
    if (!lines.length || this.seconds === null) return;
    this.programBox.hidden = false;
    const row = (n: number): HTMLElement => el("span", n === line ? { class: "now" } : {}, `${String(n).padStart(6)}  ${lines[n - 1] ?? ""}`);
    fill(this.programBox, ...[-2, -1, 0, 1, 2].map((d) => line + d).filter((n) => n >= 1 && n <= lines.length).map(row));
  }

  private toggle(): void {
    if (this.playing) {
      cancelAnimationFrame(this.playing);
      this.playing = 0;
    } else {
      if (this.seconds === null || this.seconds >= this.head!.seconds) this.setTime(0, true);
      let last = performance.now();
      const tick = (now: number): void => {
        const to = (this.seconds ?? 0) + ((now - last) / 1000) * Number(this.speed.value);
        last = now;
        this.setTime(to);
        if (to >= this.head!.seconds) {
          this.playing = 0;
          this.picture.play(false);
          this.name();
        } else this.playing = requestAnimationFrame(tick);
      };
      this.playing = requestAnimationFrame(tick);
    }
    this.picture.play(this.playing !== 0);
    this.name();
  }

  private name(): void {
    this.play.textContent = this.playing ? "❚❚" : "▶";
    this.play.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  // --- findings, places, measuring -------------------------------------------------------------------------------------------

  private choose(i: number): void {
    const f = this.head!.findings[i];
    if (!f) return;
    this.chosen = i;
    this.findingButtons.forEach((b, k) => b.setAttribute("aria-pressed", String(k === i)));
    this.findingButtons[i]!.scrollIntoView({ block: "nearest", behavior: reducedMotion() ? "auto" : "smooth" });
    // a finding of the whole part has no second, and no tool
    const here = f.time_s === null ? null : this.stands(f);
    this.setTime(f.time_s, true, here);
    const tool = here && this.head!.tools.find((t) => t.number === this.head!.steps[here.step]!.tool);
    // far enough away that the tool does not hide the place
    if (f.point) this.goTo(f.point, Math.max(0.09 * this.picture.size, 2.5, 1.6 * (tool?.diameter_mm ?? 0)), f);
    else {
      this.ring.hidden = true;
      this.marked = null;
    }
    this.say(whereOf(f));
  }

  /** How the tool stands at a finding. Its second alone does not say it: the way is thinned, and that of a job that is not proved coarse. */
  private stands(f: ViewFinding): Place | null {
    const at = this.picture.at(f.time_s!);
    if (!f.tip_mm || !f.axis || f.step === undefined || f.step === null) return at;
    return { step: f.step, place: new Vector3(...f.tip_mm), axis: new Vector3(...f.axis).normalize(), line: this.head!.withheld ? null : f.line };
  }

  private goTo(point: P3, radius: number, f: ViewFinding | null): void {
    this.marked = new Vector3(...point);
    this.ring.dataset.words = f ? f.kind : "";
    this.ring.hidden = false;
    this.picture.lookAt(point, radius);
  }

  private click(x: number, y: number): void {
    const h = this.head;
    const hit = h ? this.picture.pick(x, y) : null;
    if (!h || !hit) {
      this.ring.hidden = true;
      this.marked = null;
      if (h) this.say(this.measuring ? "There is nothing of the part; choose a place on it" : "There is nothing of the part");
      return;
    }
    if (this.measuring) {
      if (this.ruler.length >= 2) this.ruler = [];
      this.ruler.push(hit.point.clone());
      const [a, b] = this.ruler;
      this.picture.rule(a ?? null, b ?? null);
      this.marked = hit.point.clone();
      this.ring.hidden = false;
      this.ring.dataset.words = "";
      if (a && b) {
        const d = b.clone().sub(a);
        this.say(`Distance ${d.length().toFixed(3)} mm: X ${d.x.toFixed(3)}, Y ${d.y.toFixed(3)}, Z ${d.z.toFixed(3)}`);
      } else this.say(`From X ${hit.point.x.toFixed(2)} Y ${hit.point.y.toFixed(2)} Z ${hit.point.z.toFixed(2)}; choose the second place`);
      return;
    }
    this.marked = hit.point.clone();
    this.ring.hidden = false;
    this.ring.dataset.words = "";
    if (hit.cut || hit.spare !== null) {
      const of = hit.spare === null ? "part" : "stock at this time";
      this.say([hit.cut ? `Cut face of the ${of}` : "Stock at this time",
        `X ${hit.point.x.toFixed(2)} Y ${hit.point.y.toFixed(2)} Z ${hit.point.z.toFixed(2)}`].join(" · "));
      this.picture.ask();
      return;
    }
    const what = hit.label < 0 ? undefined : h.labelled[hit.label];
    const wall = h.walls.find((w) => w.faces.includes(hit.face))?.id ?? h.connections.find((c) => c.faces.includes(hit.face))?.id;
    const rest = what?.remainder === undefined ? undefined : h.remainder[what.remainder];
    const words = [`Face F${hit.face}`, wall ? (wall.startsWith("C") ? `connection ${wall}` : `wall ${wall}`) : "", what?.zone ? `zone ${what.zone}` : "",
      rest ? ["stays: " + rest.reason, needs(rest), slender([rest])].filter(Boolean).join(", ") : "",
      hit.judged === 0 ? "" : hit.judged === 2 ? "never reached by a cut" : `${hit.left < 0 ? `${(-hit.left).toFixed(4)} mm too deep` : `${hit.left.toFixed(4)} mm left`}${h.budget_mm.allowance ? `, beside the ${h.budget_mm.allowance} mm that are to stay,` : ""} at worst round here`,
      `X ${hit.point.x.toFixed(2)} Y ${hit.point.y.toFixed(2)} Z ${hit.point.z.toFixed(2)}`];
    this.say(words.filter(Boolean).join(" · "));
    this.picture.ask();
  }

  /** What a click does, at the cross in the middle, for who has no pointer. */
  private aim(): void {
    const box = this.picture.canvas.getBoundingClientRect();
    this.click(box.left + 0.5 * box.width, box.top + 0.5 * (box.height - this.legend.offsetHeight));
  }

  private setMeasuring(on: boolean): void {
    this.measuring = on;
    this.measure.setAttribute("aria-pressed", String(on));
    this.stage.classList.toggle("measuring", on);
    this.ruler = [];
    this.picture.rule(null, null);
    this.say(on ? "Measuring: choose two places of the part" : "");
  }

  private say(text: string): void {
    this.status.textContent = text;
  }

  // --- keys, names, link --------------------------------------------------------------------------------------------------------

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const p = this.picture;
    const move = e.shiftKey;
    const done: Record<string, () => void> = {
      ArrowLeft: () => p.nudge(move ? 0 : -0.12, 0, move ? 0.04 : 0, 0, 1), ArrowRight: () => p.nudge(move ? 0 : 0.12, 0, move ? -0.04 : 0, 0, 1),
      ArrowUp: () => p.nudge(0, move ? 0 : -0.1, 0, move ? -0.04 : 0, 1), ArrowDown: () => p.nudge(0, move ? 0 : 0.1, 0, move ? 0.04 : 0, 1),
      "+": () => p.nudge(0, 0, 0, 0, 0.85), "=": () => p.nudge(0, 0, 0, 0, 0.85), "-": () => p.nudge(0, 0, 0, 0, 1 / 0.85),
      f: () => p.fit(), "7": () => p.fit([0, -0.001, 1]), "1": () => p.fit([0, -1, 0.02]), "3": () => p.fit([1, 0, 0.02]),
      z: () => this.setMode("zones"), w: () => this.setMode("walls"), d: () => this.setMode("deviation"),
      m: () => this.setMeasuring(!this.measuring), Enter: () => this.aim(), " ": () => this.toggle(),
      n: () => this.choose(Math.min(this.findingButtons.length - 1, this.chosen + 1)), p: () => this.choose(Math.max(0, this.chosen - 1)),
      Escape: () => (this.setMeasuring(false), this.setTime(null)),
      ".": () => this.setTime((this.seconds ?? 0) + 1, true), ",": () => this.setTime((this.seconds ?? this.head!.seconds) - 1, true),
      "?": () => this.say("Arrows turn, shift and arrows move, + and − near; F all, 7 top, 1 front, 3 side; Z W D colours; N P findings; space plays, comma and full stop one second; Enter says what is under the cross, M measures from cross to cross; Escape ends."),
    };
    const act = done[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (act && this.head) {
      e.preventDefault();
      act();
    }
  }

  private placeNames(): void {
    if (this.marked && !this.ring.hidden) {
      const at = this.picture.screen(this.marked);
      this.ring.style.transform = at ? `translate(${at.x}px, ${at.y}px)` : "translate(-999px, -999px)";
    }
    if (this.names.hidden) return;
    const taken: { x: number; y: number }[] = [];
    for (const { node, place } of this.labels) {
      const at = this.picture.screen(place);
      const free = at && this.picture.kept(place) && !taken.some((t) => Math.abs(t.x - at.x) < 26 && Math.abs(t.y - at.y) < 18);
      node.style.transform = at && free ? `translate(${at.x}px, ${at.y}px) translate(-50%, -50%)` : "translate(-999px, -999px)";
      if (at && free) taken.push(at);
    }
    clearTimeout(this.freeTimer);
    this.freeTimer = window.setTimeout(() => {
      for (const { node, place } of this.labels) node.classList.toggle("behind", !this.picture.free(place));
    }, 120);
  }

  /** The look into the address, soon: browsers refuse a page that changes it more than a few times a second. */
  private remember(): void {
    if (!this.ready || this.writing) return;
    const soon = this.written + 500 - performance.now();
    if (soon <= 0) this.write();
    else this.writing = window.setTimeout(() => this.write(), soon);
  }

  private write(): void {
    clearTimeout(this.writing);
    this.writing = 0;
    if (!this.ready || !this.stage.isConnected) return;
    this.written = performance.now();
    const q = [`c=${this.picture.pose.join(",")}`];
    q.push(`m=${this.mode}`);
    if (this.seconds !== null) q.push(`t=${this.seconds.toFixed(1)}`);
    if (this.sectionAxis.value !== "") q.push(`s=${this.sectionAxis.value},${Number(this.sectionPlace.value) / 1000},${this.sectionFlip.checked ? 1 : 0}`);
    const steps = [...this.shown()];
    if (steps.length) q.push(`p=${steps.join(".")}`);
    history.replaceState(null, "", `#${q.join("&")}`);
  }
}
