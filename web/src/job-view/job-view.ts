// The view of a finished job: the scene, the time bar and the panel, and what joins them.
import { Vector3 } from "three";
import type { Mode } from "../scene/part";
import type { P3 } from "../scene/coordinates";
import type { ToolPosition } from "../scene/paths";
import { JobScene } from "../scene/scene";
import type { Job, JobFiles } from "../shared/api";
import { add, el, fill } from "../shared/dom";
import { onTheme, reducedMotion, themeColour } from "../shared/page-frame";
import type { ViewFinding, ViewHead } from "../shared/view-file";
import { findingPlace } from "../shared/wording";
import { FindingList } from "./finding-list";
import { Inspection } from "./inspection";
import { KEYS_IN_WORDS, keyActions } from "./keyboard";
import { legendOf } from "./legend";
import { Markers } from "./markers";
import { buildPanel } from "./panel";
import { ProgramLines } from "./program-lines";
import { SectionControls } from "./section-controls";
import { StepList } from "./step-list";
import { summaryOf } from "./summary";
import { TimeBar } from "./time-bar";
import { LinkWriter, lookOf, type Look } from "./view-link";
import { viewButtons } from "./view-buttons";

const CLICK_PX = 6; // the pointer moves less during a click

export class JobView {
  readonly nodes: HTMLElement[];
  readonly scene: JobScene;
  private head: ViewHead | null = null;
  private readonly stage = el("div", { class: "stage" });
  private readonly status = el("p", { class: "status", role: "status", tabindex: 0 });
  private readonly busy = el("p", { class: "busy" }, "Loading…");
  private readonly legend = el("div", { class: "legend" });
  private readonly panel = el("aside", { class: "panel", "aria-label": "Job details" });
  private readonly left: HTMLElement;
  private readonly modes: Record<Mode, HTMLInputElement> = { zones: this.modeButton("zones"), walls: this.modeButton("walls"), deviation: this.modeButton("deviation") };
  private readonly markers: Markers;
  private readonly inspection: Inspection;
  private readonly findings = new FindingList((i) => this.showFinding(i));
  private readonly steps: StepList;
  private readonly time: TimeBar;
  private readonly program: ProgramLines;
  private readonly section: SectionControls;
  private readonly link: LinkWriter;
  private readonly opened: Look; // of the address with which the page was opened
  private stockShown = false;

  constructor(private readonly job: Job, private readonly files: JobFiles) {
    this.scene = new JobScene(this.stage);
    this.opened = lookOf(location.hash);
    this.markers = new Markers(this.scene);
    this.inspection = new Inspection(this.scene, this.markers, this.stage, () => this.legend.offsetHeight, (text) => this.say(text));
    this.steps = new StepList({
      onSteps: () => this.showSteps(),
      onHolder: (on) => {
        this.scene.showHolder(on);
        if (this.time.seconds !== null) this.setTime(this.time.seconds);
      },
      onTime: (seconds) => this.setTime(seconds, true),
    });
    this.time = new TimeBar({
      onTime: (seconds, ensure) => this.setTime(seconds, ensure),
      onPlay: (on) => this.scene.play(on),
      onStock: (on) => {
        this.scene.showStock(on);
        this.setTime(this.time.seconds ?? this.head!.seconds);
      },
    });
    this.program = new ProgramLines(files);
    this.section = new SectionControls(this.scene, (text) => this.say(text), () => this.link.changed());
    this.link = new LinkWriter(this.stage, () => ({
      pose: this.scene.pose, mode: this.mode, seconds: this.time.seconds, section: this.section.state, steps: this.steps.shown,
    }));
    this.left = el("div", { class: "left" }, this.stage, this.status, this.time.node);
    this.nodes = [this.left, this.program.node, this.panel];
    add(this.stage, el("div", { class: "aim", "aria-hidden": "true" }), this.markers.names, this.markers.ring, this.busy, this.legend,
      viewButtons((direction) => {
        this.scene.fit(direction);
        this.link.changed();
      }));
    this.listen();
  }

  private listen(): void {
    const { canvas } = this.scene;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", "3D view of the part. Arrow keys turn it, Shift and arrow keys move it, plus and minus zoom. "
      + "Enter describes the place under the cross, F fits the part, question mark lists the keys.");
    canvas.addEventListener("keydown", (e) => this.key(e));
    let down: { x: number; y: number } | null = null;
    canvas.addEventListener("pointerdown", (e) => (down = { x: e.clientX, y: e.clientY }));
    canvas.addEventListener("pointerup", (e) => {
      if (down && Math.hypot(e.clientX - down.x, e.clientY - down.y) < CLICK_PX) this.inspection.click(e.clientX, e.clientY);
      down = null;
    });
    this.scene.onDraw = () => this.markers.place();
    this.scene.onMove = () => this.link.changed();
    onTheme(() => this.paint());
    // a link to another look of the same job changes the address alone
    addEventListener("hashchange", (e) => {
      const look = lookOf(new URL(e.newURL).hash); // the address itself may have been written again meanwhile
      if (this.link.ready && look.pose && this.stage.isConnected) this.takeLook(look);
    });
  }

  // --- loading

  start(): void {
    this.paint();
  }

  begin(h: ViewHead): void {
    this.head = h;
    this.scene.begin(h);
    this.inspection.begin(h);
    this.section.begin(h);
    fill(this.panel, ...buildPanel(h, this.files, {
      modes: this.modes, findings: this.findings, steps: this.steps, section: this.section, measureButton: this.inspection.button,
      stepsOpen: this.opened.steps !== undefined,
      onHighlight: (labels) => this.scene.highlight(labels),
      onPlace: (point) => this.goTo(point, Math.max(0.12 * this.scene.size, 3)),
      onCopyLink: () => this.copyLink(),
      onSavePicture: () => el("a", { href: this.scene.png(), download: `${this.job.id}.png` }).click(),
    }));
    this.time.begin(h, this.scene.hasStock);
    this.markers.begin(h);
    this.setMode((h.state === "unproved" && h.findings.length > 0) || h.kind === "verify" ? "deviation" : "zones");
    this.scene.fit();
    this.showLook(this.opened);
    this.say(summaryOf(h));
  }

  /** The rough level is loaded, `ms` after the page was opened. */
  roughDone(ms: number): void {
    this.left.dataset.rough = String(Math.round(ms));
    this.busy.textContent = "Loading details…";
  }

  /** Everything is loaded. */
  finish(bytes: number, ms: number): void {
    this.scene.settle();
    this.busy.remove();
    this.left.dataset.bytes = String(bytes);
    this.left.dataset.ready = String(Math.round(ms));
    this.link.ready = true;
    if (this.opened.seconds !== undefined) this.setTime(this.opened.seconds);
    this.link.changed();
    // for tests and measurements
    (window as unknown as { zonemill: unknown }).zonemill = { picture: this.scene, frame: () => this.scene.timed(), moving: () => this.scene.timedMoving() };
  }

  private paint(): void {
    this.scene.theme(themeColour("--stage"), themeColour("--ink"));
  }

  // --- the look in the address

  /** Shows colours, camera, section and steps of a look; the rest stays. */
  private showLook(look: Look): void {
    if (look.mode) this.setMode(look.mode);
    if (look.pose) this.scene.pose = look.pose;
    if (look.section) this.section.set(look.section);
    if (look.steps) this.steps.shown = look.steps;
    this.showSteps();
  }

  /** Shows a look completely; what the look leaves out is removed. */
  private takeLook(look: Look): void {
    this.section.set(null);
    this.showLook({ steps: new Set(), ...look });
    this.setTime(look.seconds ?? null);
  }

  private copyLink(): void {
    this.link.write();
    // a browser has a clipboard only over https and on this machine
    const copied = navigator.clipboard ? navigator.clipboard.writeText(location.href) : Promise.reject(new Error("no clipboard"));
    copied.then(() => this.say("The link is copied. It opens this job with this view."),
      () => this.say("This browser does not let the page copy. Copy the address of this page instead."));
  }

  // --- colours and steps

  private modeButton(mode: Mode): HTMLInputElement {
    return el("input", { type: "radio", name: "mode", id: `mode-${mode}`, value: mode, onchange: () => this.setMode(mode) });
  }

  private get mode(): Mode {
    return (Object.entries(this.modes) as [Mode, HTMLInputElement][]).find(([, i]) => i.checked)?.[0] ?? "zones";
  }

  private setMode(mode: Mode): void {
    if (mode === "zones" && this.head?.kind === "verify") return; // a verification has no zones
    this.modes[mode].checked = true;
    this.scene.setMode(mode);
    this.markers.names.hidden = mode === "deviation";
    this.buildLegend();
    this.link.changed();
  }

  private showSteps(): void {
    this.scene.showPaths(this.steps.shown, this.steps.rapidsShown);
    this.steps.refresh();
    this.buildLegend();
    this.link.changed();
  }

  private buildLegend(): void {
    const h = this.head;
    if (!h) return;
    fill(this.legend, ...legendOf(h, this.mode, new Set([...this.steps.shown].map((i) => h.steps[i]!.tool)), this.stockShown));
    const covered = this.legend.offsetHeight;
    this.scene.setCovered(covered);
    this.stage.style.setProperty("--covered", `${covered}px`);
  }

  // --- time

  /** Goes to a second, null: no tool. `ensure`: its step is shown then. `known`: how the tool stands, if known better than from the path. */
  private setTime(seconds: number | null, ensure = false, known: ToolPosition | null = null): void {
    const h = this.head!;
    const second = seconds === null ? null : Math.min(h.seconds, Math.max(0, seconds));
    this.time.seconds = second;
    if (second !== null && (ensure || this.steps.shown.size === 0 || this.time.playing) && this.steps.check((known ?? this.scene.at(second))?.step ?? -1)) this.showSteps();
    const position = this.scene.setTime(second, known);
    const stock = position !== null && this.time.stockWanted && this.scene.hasStock;
    if (stock !== this.stockShown) {
      this.stockShown = stock;
      this.buildLegend();
    }
    this.time.show(position);
    if (position && second !== null) this.program.show(h.steps[position.step]!.program, position.line);
    else this.program.hide();
    this.link.changed();
  }

  // --- findings and places

  private showFinding(i: number): void {
    const f = this.head!.findings[i];
    if (!f) return;
    this.findings.press(i, !reducedMotion());
    // a finding of the whole part has no second and no tool
    const position = f.time_s === null ? null : this.toolAt(f, f.time_s);
    this.setTime(f.time_s, true, position);
    const tool = position && this.head!.tools.find((t) => t.number === this.head!.steps[position.step]!.tool);
    // far enough away that the tool does not hide the place
    if (f.point) this.goTo(f.point, Math.max(0.09 * this.scene.size, 2.5, 1.6 * (tool?.diameter_mm ?? 0)), f.kind);
    else this.markers.unmark();
    this.say(findingPlace(f));
  }

  /** Position of the tool at a finding. The second alone is not enough: the path is thinned, and coarse if the job is unproved. */
  private toolAt(f: ViewFinding, seconds: number): ToolPosition | null {
    if (!f.tip_mm || !f.axis || f.step === undefined || f.step === null) return this.scene.at(seconds);
    return { step: f.step, place: new Vector3(...f.tip_mm), axis: new Vector3(...f.axis).normalize(), line: this.head!.withheld ? null : f.line };
  }

  private goTo(point: P3, radius: number, words = ""): void {
    this.markers.mark(new Vector3(...point), words);
    this.scene.lookAt(point, radius);
  }

  private say(text: string): void {
    this.status.textContent = text;
  }

  // --- keys

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey || !this.head) return;
    const actions = keyActions(e.shiftKey, {
      nudge: (...by) => this.scene.nudge(...by), fit: (direction) => this.scene.fit(direction), setMode: (mode) => this.setMode(mode),
      measure: () => this.inspection.toggle(), describe: () => this.inspection.describeCentre(), play: () => this.time.toggle(),
      nextFinding: (by) => this.showFinding(this.findings.neighbour(by)),
      clear: () => {
        this.inspection.setMeasuring(false);
        this.setTime(null);
      },
      skip: (seconds) => this.setTime((this.time.seconds ?? (seconds > 0 ? 0 : this.head!.seconds)) + seconds, true),
      help: () => this.say(KEYS_IN_WORDS),
    });
    const action = actions[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (!action) return;
    e.preventDefault();
    action();
  }
}

