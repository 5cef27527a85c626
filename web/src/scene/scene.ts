// The scene of a job: part, tool paths, tool, stock and section, seen by one camera. It draws only when something has changed.
import { BufferGeometry, Color, DirectionalLight, Group, HemisphereLight, LineBasicMaterial, LineSegments, Scene, type Vector3 } from "three";
import type { ChunkEntry, Table, ViewHead } from "../shared/view-file";
import { Camera } from "./camera";
import { HIGHLIGHT } from "./colours";
import { boundsOf, type Bounds, type P3 } from "./coordinates";
import { FrameRenderer } from "./frame-renderer";
import { Part, type Mode } from "./part";
import { Paths, type ToolPosition } from "./paths";
import { Picking, type Hit } from "./picking";
import { Section } from "./section";
import { Stock } from "./stock";
import { Tool } from "./tool";

export class JobScene {
  onDraw: () => void = () => {};
  onMove: () => void = () => {};
  readonly canvas: HTMLCanvasElement;
  private readonly scene = new Scene();
  private readonly section = new Section();
  private readonly part = new Part(this.section);
  private readonly paths = new Paths(this.section);
  private readonly tool = new Tool();
  private readonly ruler = new Group();
  private readonly camera = new Camera(() => this.draw());
  private readonly frames: FrameRenderer;
  private readonly picking = new Picking(this.camera, this.part, this.section, () => (this.stock?.mesh.visible ? this.stock : null));
  private stock: Stock | null = null;
  private stockWanted = true;
  private head: ViewHead | null = null;
  private bounds: Bounds | null = null;

  constructor(place: HTMLElement) {
    this.frames = new FrameRenderer(this.scene, this.camera.perspective, () => this.onDraw(), () => this.showLevel());
    this.canvas = this.frames.canvas;
    place.appendChild(this.canvas);
    this.camera.attach(this.canvas, () => this.frames.startMotion(), () => {
      this.frames.endMotion();
      this.onMove();
    });
    const light = new DirectionalLight(0xffffff, 1.6);
    light.position.set(-0.3, -0.5, 1);
    this.scene.add(new HemisphereLight(0xffffff, 0x8a8f98, 1.6), light, this.part.group, this.paths.group, this.tool.group, this.ruler,
      this.part.highlighted, this.section.faces);
    new ResizeObserver(() => this.resize(place)).observe(place);
    this.resize(place);
  }

  private resize({ clientWidth: w, clientHeight: h }: HTMLElement): void {
    if (!w || !h) return;
    this.frames.resize(w, h);
    this.camera.resize(w, h);
  }

  // --- what is loaded

  begin(head: ViewHead): void {
    this.head = head;
    this.bounds = boundsOf(head);
    this.part.begin(head);
    this.paths.begin(head);
    this.camera.begin(this.bounds);
  }

  /** Adds a chunk of the view file. */
  chunk(entry: ChunkEntry, t: Table): void {
    if (entry.kind === "mesh") this.part.addFacets(entry, t);
    if (entry.kind === "edges") {
      this.part.addEdges(t);
      this.fillSection();
    }
    if (entry.kind === "path") this.paths.add(entry, t);
    if (entry.kind === "field") {
      this.stock = new Stock(entry, t, this.section.uniform, this.head!.budget_mm.scallop);
      this.scene.add(this.stock.mesh);
    }
    this.showLevel();
    this.draw();
  }

  /** Everything is loaded. */
  settle(): void {
    this.part.settle();
    this.stock?.forgetPaths();
    this.fillSection();
    this.showLevel();
    this.draw();
  }

  // --- what is shown

  theme(background: string, ink: string): void {
    this.scene.background = new Color(background);
    this.part.theme(background, ink);
    this.draw();
  }

  setMode(mode: Mode): void {
    this.part.setMode(mode);
    this.showLevel();
    this.draw();
  }

  highlight(labels: Set<number> | null): void {
    this.part.highlight(labels);
    this.draw();
  }

  showPaths(steps: Set<number>, rapids: boolean): void {
    this.paths.show(steps, rapids);
    this.showLevel();
    this.draw();
  }

  showHolder(on: boolean): void {
    this.tool.showHolder(on);
  }

  get hasStock(): boolean {
    return this.head!.chunks.some((c) => c.kind === "field");
  }

  /** Counts from the next `setTime`. */
  showStock(on: boolean): void {
    this.stockWanted = on;
  }

  /** Cuts away what lies beyond a plane across an axis, at a share of the part; null: nothing. */
  cutAway(axis: 0 | 1 | 2 | null, share: number, flipped: boolean): void {
    this.section.set(axis, share, flipped, this.bounds!);
    this.part.clip();
    this.fillSection();
    this.showSection();
    this.draw();
  }

  /** Draws a straight line between two places that nothing hides; null removes it. */
  showRuler(a: Vector3 | null, b: Vector3 | null): void {
    this.ruler.clear();
    if (a && b) {
      const line = new LineSegments(new BufferGeometry().setFromPoints([a, b]), new LineBasicMaterial({ color: HIGHLIGHT, depthTest: false }));
      line.renderOrder = 9;
      this.ruler.add(line);
    }
    this.draw();
  }

  /** While something moves on a slow machine the rough level is drawn, else the fine one. */
  private showLevel(): void {
    const rough = this.frames.resolution < 1;
    this.part.showLevel(rough);
    this.part.fade(this.paths.anyShown);
    this.paths.showLevel(rough);
    this.showSection();
  }

  private fillSection(): void {
    this.section.fill(this.part.meshes, this.stock ? [this.stock.mesh] : [], this.bounds!);
  }

  private showSection(): void {
    this.section.show(this.frames.resolution === 1, this.stock?.mesh.visible === true);
  }

  // --- time

  /** Position of the tool at a second; null if there is no path. */
  at(seconds: number): ToolPosition | null {
    return this.paths.at(seconds);
  }

  /** Shows tool, paths and stock at a second, or the tool at a position known better; null: no tool, all paths as done. */
  setTime(seconds: number | null, known: ToolPosition | null = null): ToolPosition | null {
    this.paths.setTime(seconds);
    const position = seconds === null ? null : (known ?? this.at(seconds));
    this.stock?.showAt(position && this.stockWanted ? seconds : null, this.paths);
    this.showSection();
    if (position) {
      const { tool } = this.head!.steps[position.step]!;
      this.tool.show(position, tool, this.head!.tools.find((t) => t.number === tool), known !== null);
    } else this.tool.hide();
    this.draw();
    return position;
  }

  /** While time plays, coarse frames are better than late ones. */
  play(on: boolean): void {
    if (on) this.frames.startMotion();
    else this.frames.endMotion();
  }

  // --- the camera

  get size(): number {
    return this.bounds!.size;
  }

  /** Whether the camera is on the low side of the part along an axis. */
  isSeenFromBelow(axis: number): boolean {
    return this.camera.perspective.position.getComponent(axis) < this.bounds!.middle.getComponent(axis);
  }

  fit(direction?: P3): void {
    this.camera.fit(direction);
  }

  /** Looks at a place from where it can be seen. */
  lookAt(point: P3, radius: number): void {
    this.camera.lookAt(point, radius, (ray) => this.picking.isFree(ray));
    this.onMove();
  }

  nudge(turn: number, tilt: number, x: number, y: number, factor: number): void {
    this.camera.nudge(turn, tilt, x, y, factor);
    this.onMove();
  }

  get pose(): number[] {
    return this.camera.pose;
  }

  set pose(p: number[]) {
    this.camera.pose = p;
  }

  setCovered(pixels: number): void {
    this.camera.setCovered(pixels);
  }

  // --- places

  pick(x: number, y: number): Hit | null {
    return this.picking.pick(this.canvas, x, y);
  }

  screen(p: Vector3): { x: number; y: number } | null {
    return this.camera.screen(p);
  }

  /** Whether the section leaves a place. */
  keeps(p: Vector3): boolean {
    return this.section.keeps(p);
  }

  isVisible(p: Vector3): boolean {
    return this.picking.isVisible(p, this.size);
  }

  // --- frames

  draw(): void {
    this.frames.request();
  }

  get resolution(): number {
    return this.frames.resolution;
  }

  timed(): number {
    return this.frames.timed();
  }

  timedMoving(): number {
    return this.frames.timedMoving();
  }

  png(): string {
    return this.frames.png();
  }
}
