// The picture: part, ways of the tool, tool, section, marks. It draws only when something has changed.
import {
  BufferAttribute, BufferGeometry, Color, DoubleSide, Group, LatheGeometry, LineSegments,
  Mesh, MeshBasicMaterial, MeshLambertMaterial, HemisphereLight, DirectionalLight, PerspectiveCamera, Plane, Quaternion, Raycaster, Scene,
  ShaderMaterial, Vector2, Vector3, Vector4, WebGLRenderer, LineBasicMaterial, LinearSRGBColorSpace, GLSL3, type Intersection,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { CLASSES, CONNECTION, OTHER, PALE, REMAINDER, STEPS, STOCK, UNCUT, toolColour, wallColour, zoneColour, type RGB } from "./colours";
import { CutFace } from "./cut-face";
import { PART_FRAGMENT, PART_VERTEX, WAY_FRAGMENT, WAY_VERTEX } from "./shaders";
import type { Course } from "./stock-states";
import { Stock } from "./stock";
import type { ChunkEntry, Table, ViewHead } from "../shared/view-file";


export type Mode = "zones" | "walls" | "deviation";
export type P3 = [number, number, number];

/** Where the tip is, along which axis, and what leads there. */
export interface Place {
  step: number;
  place: Vector3;
  axis: Vector3;
  line: number | null;
}

/** What is kept of one workingstep. */
interface Way {
  lod: number;
  place: Float32Array;
  time: Float32Array;
  kind: Uint8Array;
  axis: Float32Array | null;
  line: Int32Array | null;
  cut: LineSegments;
  rapid: LineSegments;
}

/** A place that is seen; `cut`: on the plane of the section; `spare`: on stock, so many mm out of the part, up to a step of its grid. */
export interface Hit {
  point: Vector3;
  cut: boolean;
  spare: number | null;
  face: number;
  label: number;
  left: number;
  judged: number;
}

/** Whether the browser draws without a graphics card: smooth edges then cost more than they give. */
function drawnBySoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(gl!.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

const NO_SECTION = new Vector4(0, 0, 0, 1);

export class Picture {
  readonly canvas: HTMLCanvasElement;
  readonly controls: OrbitControls;
  readonly camera = new PerspectiveCamera(32, 1, 0.1, 10000);
  private drawn = 0;
  private renderer: WebGLRenderer;
  private scene = new Scene();
  private part = new Group();
  private edges: LineSegments | null = null;
  private paths = new Group();
  private tool = new Group();
  private marks = new Group();
  private roughPart = new Map<number, Mesh>();
  private roughWays = new Map<number, [LineSegments, LineSegments]>();
  private shine = new Group();
  private parts = new Map<number, { lod: number; mesh: Mesh }>();
  private ways = new Map<number, Way>();
  private section = NO_SECTION.clone();
  private plane = new Plane();
  private cutPart: CutFace;
  private cutStock_: CutFace;
  private shared: Record<string, { value: unknown }>;
  private asked = false;
  private toolShown = -1;
  private head: ViewHead | null = null;
  private wallOf = new Map<number, RGB>();
  private shownSteps = new Set<number>();
  private rapids = false;
  private holder = true;
  onDraw: () => void = () => {};
  onMove: () => void = () => {};

  constructor(place: HTMLElement) {
    this.renderer = new WebGLRenderer({ stencil: true, antialias: !drawnBySoftware(), powerPreference: "high-performance" });
    this.canvas = this.renderer.domElement;
    // a phone takes the graphics card away from a page that was put aside, and gives it back
    this.canvas.addEventListener("webglcontextrestored", () => this.ask());
    place.appendChild(this.canvas);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.ask());
    this.controls.addEventListener("start", () => (this.moving = true));
    this.controls.addEventListener("end", () => {
      this.rest();
      this.onMove();
    });
    const light = new DirectionalLight(0xffffff, 1.6);
    light.position.set(-0.3, -0.5, 1);
    this.scene.add(new HemisphereLight(0xffffff, 0x8a8f98, 1.6), light, this.part, this.paths, this.tool, this.marks, this.shine);
    this.shared = {
      mode: { value: 0 }, faded: { value: 0 }, lit: { value: 0.06 }, section: { value: this.section },
      limits: { value: [0, 0, 0, 0, 0, 0] }, classes: { value: CLASSES.map((c) => new Color(...c)) },
      uncut: { value: new Color(...UNCUT) }, pale: { value: new Color(...PALE) }, stripe: { value: new Color(...REMAINDER) },
      cap: { value: new Color(0.55, 0.57, 0.6) }, paper: { value: new Color(1, 1, 1) }, now: { value: Infinity },
    };
    this.cutPart = new CutFace(this.shared.section!, this.shared.cap!.value as Color, -2);
    this.cutStock_ = new CutFace(this.shared.section!, new Color(...STOCK), -4);
    this.scene.add(this.cutPart.group, this.cutStock_.group);
    new ResizeObserver(() => this.resize(place)).observe(place);
    this.resize(place);
  }

  private moving = false;
  private coarse = 1;
  private resting = 0;

  /** Ends the coarse pictures a slow machine draws while something moves. */
  private rest(): void {
    this.moving = false;
    clearTimeout(this.resting);
    this.resting = window.setTimeout(() => this.grain(1), 150);
  }

  private grain(share: number): void {
    if (share === this.coarse) return;
    this.coarse = share;
    this.showLevels();
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2) * share);
    this.ask();
  }

  /** Something plays: frames come one after the other, and coarse ones are better than late ones. */
  play(on: boolean): void {
    if (on) this.moving = true;
    else this.rest();
  }

  private resize(place: HTMLElement): void {
    const { clientWidth: w, clientHeight: h } = place;
    if (!w || !h) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2) * this.coarse);
    this.renderer.setSize(w, h, false);
    this.camera.aspect = w / h;
    this.above(this.covered);
    this.ask();
  }

  /** The lowest pixels of the picture are covered: its middle is that of the rest. */
  above(pixels: number): void {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    this.covered = pixels;
    if (w && h) this.camera.setViewOffset(w, h, 0, 0.5 * pixels, w, h);
    this.ask();
  }
  private covered = 0;

  /** Draws before the browser shows the next picture. */
  ask(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      const gap = performance.now() - this.drawn;
      this.drawn = performance.now();
      if (this.moving && gap > 70 && gap < 2000) this.grain(Math.max(0.4, this.coarse * 0.75));
      this.renderer.render(this.scene, this.camera);
      this.onDraw();
    });
  }

  /** Draws at once and waits until it is drawn; ms. */
  timed(): number {
    const from = performance.now();
    this.renderer.render(this.scene, this.camera);
    const gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    return performance.now() - from;
  }

  /** The same while something moves: the rough level, on fewer pixels. */
  timedMoving(): number {
    const kept = this.coarse;
    this.grain(0.5);
    const took = Math.min(this.timed(), this.timed());
    this.grain(kept);
    this.timed();
    return took;
  }

  png(): string {
    this.renderer.render(this.scene, this.camera);
    return this.canvas.toDataURL("image/png");
  }

  theme(background: string, ink: string): void {
    this.scene.background = new Color(background);
    (this.shared.paper!.value as Color).setStyle(background, LinearSRGBColorSpace).lerp(new Color(1, 1, 1), 0.35);
    if (this.edges) (this.edges.material as LineBasicMaterial).color.set(ink);
    this.ink = ink;
    this.ask();
  }
  private ink = "#15202b";

  begin(head: ViewHead): void {
    this.head = head;
    head.walls.forEach((w, i) => w.faces.forEach((f) => this.wallOf.set(f, wallColour(i))));
    head.connections.forEach((c) => c.faces.forEach((f) => this.wallOf.set(f, CONNECTION)));
    const low = head.budget_mm.gouge + 1e-6;
    const high = head.budget_mm.scallop + 1e-6;
    this.shared.limits!.value = [-STEPS[1]! * low, -STEPS[0]! * low, -low, high, STEPS[0]! * high, STEPS[1]! * high];
    this.fit();
  }

  chunk(entry: ChunkEntry, t: Table): void {
    if (entry.kind === "mesh") this.addPart(entry, t);
    else if (entry.kind === "edges") this.addEdges(t);
    else if (entry.kind === "field") this.addStock(entry, t);
    else if (entry.kind === "path") this.addWay(entry, t);
    this.ask();
  }

  private places(t: Table, grid: number): Float32Array {
    const [x, y, z] = this.head!.low_mm;
    const from = t.place!;
    const out = new Float32Array(from.length);
    for (let i = 0; i < from.length; i += 3) {
      out[i] = x + grid * from[i]!;
      out[i + 1] = y + grid * from[i + 1]!;
      out[i + 2] = z + grid * from[i + 2]!;
    }
    return out;
  }

  private addPart(entry: ChunkEntry, t: Table): void {
    const head = this.head!;
    const label = entry.label!;
    const n = t.face!.length;
    const g = new BufferGeometry();
    g.setAttribute("position", new BufferAttribute(this.places(t, head.mesh_grid_mm), 3));
    g.setAttribute("normal", new BufferAttribute(Int8Array.from(t.normal!), 3, true));
    const left = new Float32Array(n);
    const wall = new Uint8Array(3 * n);
    const none: RGB = [0.82, 0.83, 0.84];
    for (let i = 0; i < n; i++) {
      left[i] = t.left![i]! * head.left_unit_mm;
      const c = this.wallOf.get(t.face![i]!) ?? none;
      for (let k = 0; k < 3; k++) wall[3 * i + k] = 255 * c[k]!;
    }
    g.setAttribute("left_", new BufferAttribute(left, 1));
    g.setAttribute("judged", new BufferAttribute(Uint8Array.from(t.judged!), 1));
    g.setAttribute("wall", new BufferAttribute(wall, 3, true));
    g.setIndex(new BufferAttribute(Uint32Array.from(t.corners!), 1));
    const mesh = new Mesh(g, this.partMaterial(label));
    mesh.userData = { label, face: t.face };
    const old = this.parts.get(label);
    if (old && old.lod > entry.lod) return;
    if (old) {
      old.mesh.material = mesh.material; // one look for both levels
      this.roughPart.set(label, old.mesh);
    }
    this.parts.set(label, { lod: entry.lod, mesh });
    this.part.add(mesh);
    this.showLevels();
  }

  /** The rough facets of labels that have none in the fine level are in the way of it. */
  settle(): void {
    const finest = Math.max(0, ...[...this.parts.values()].map((p) => p.lod));
    for (const [label, p] of this.parts)
      if (p.lod < finest && this.head!.chunks.some((c) => c.kind === "mesh" && c.lod === finest)) {
        this.part.remove(p.mesh);
        this.parts.delete(label);
      }
    this.showLevels();
    this.fillCut();
    this.stockFed = false;
    this.ask();
  }

  colourOf(label: number): { colour: RGB; hatched: boolean } {
    const what = label < 0 ? undefined : this.head!.labelled[label];
    if (what?.zone) return { colour: zoneColour(this.head!.zones.findIndex((z) => z.id === what.zone)), hatched: false };
    if (what?.remainder !== undefined) return { colour: [0.98, 0.86, 0.84], hatched: true };
    return { colour: OTHER, hatched: false };
  }

  private partMaterial(label: number): ShaderMaterial {
    const { colour, hatched } = this.colourOf(label);
    return new ShaderMaterial({
      glslVersion: GLSL3, vertexShader: PART_VERTEX, fragmentShader: PART_FRAGMENT, side: DoubleSide,
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
      uniforms: { ...this.shared, own: { value: new Color(...colour) }, hatched: { value: hatched ? 1 : 0 } } as never,
    });
  }

  /** Makes some labels stand out; none: all as they are. */
  highlight(labels: Set<number> | null): void {
    for (const [label, { mesh }] of this.parts) {
      const m = mesh.material as ShaderMaterial;
      m.uniforms.faded = labels ? { value: labels.has(label) ? 0 : 0.82 } : (this.shared.faded as never);
      m.uniforms.lit = labels?.has(label) ? { value: 0.16 } : (this.shared.lit as never);
    }
    // what stands out shines through what stands before it
    this.shine.clear();
    for (const label of labels ?? []) {
      const known = this.parts.get(label);
      if (!known) continue;
      const through = new Mesh(known.mesh.geometry, new MeshBasicMaterial({ color: 0xe0007a, transparent: true, opacity: 0.28, depthTest: false, depthWrite: false, side: DoubleSide, clippingPlanes: this.cutting ? [this.plane] : [] }));
      through.renderOrder = 5;
      this.shine.add(through);
    }
    this.ask();
  }

  private addEdges(t: Table): void {
    const place = this.places(t, this.head!.mesh_grid_mm);
    const begins = t.begins!;
    const index: number[] = [];
    for (let k = 0; k + 1 < begins.length; k++)
      for (let i = begins[k]!; i + 1 < begins[k + 1]!; i++) index.push(i, i + 1);
    const g = new BufferGeometry();
    g.setAttribute("position", new BufferAttribute(place, 3));
    g.setIndex(index);
    this.edges = new LineSegments(g, new LineBasicMaterial({ color: this.ink, transparent: true, opacity: 0.7 }));
    this.part.add(this.edges);
    this.clip();
  }

  private addWay(entry: ChunkEntry, t: Table): void {
    const head = this.head!;
    const step = entry.step!;
    const old = this.ways.get(step);
    if (old && old.lod > entry.lod) return;
    const place = this.places(t, head.path_grid_mm);
    const n = t.kind!.length;
    const time = new Float32Array(n);
    for (let i = 0; i < n; i++) time[i] = t.time![i]! / 1000;
    const axis = t.axis ? Float32Array.from(t.axis, (v) => v / head.axis_unit) : null;
    const cuts: number[] = [];
    const moves: number[] = [];
    for (let i = 1; i < n; i++) if (t.kind![i] !== 0) (t.kind![i] === 2 ? cuts : moves).push(i - 1, i);
    const g = (index: number[]): BufferGeometry => {
      const out = new BufferGeometry();
      out.setAttribute("position", at);
      out.setAttribute("time", when);
      out.setIndex(new BufferAttribute(Uint32Array.from(index), 1));
      return out;
    };
    const at = new BufferAttribute(place, 3);
    const when = new BufferAttribute(time, 1);
    const tools = head.tools.map((x) => x.number);
    const colour = toolColour(Math.max(0, tools.indexOf(head.steps[step]!.tool)));
    const cut = new LineSegments(g(cuts), this.wayMaterial(colour, head.steps[step]!.operation === "roughing" ? 0.45 : 0.85, 0));
    const rapid = new LineSegments(g(moves), this.wayMaterial([0.35, 0.37, 0.42], 0.7, 1));
    if (old) {
      [old.cut.material, old.rapid.material] = [cut.material, rapid.material];
      this.roughWays.set(step, [old.cut, old.rapid]);
    }
    this.paths.add(cut, rapid);
    this.ways.set(step, { lod: entry.lod, place, time, kind: Uint8Array.from(t.kind!), axis, line: t.line ?? null, cut, rapid });
    this.showWays();
  }

  private wayMaterial(colour: RGB, strength: number, dashed: number): ShaderMaterial {
    return new ShaderMaterial({
      glslVersion: GLSL3, vertexShader: WAY_VERTEX, fragmentShader: WAY_FRAGMENT, transparent: true, depthWrite: false,
      uniforms: { section: this.shared.section, now: this.shared.now, colour: { value: new Color(...colour) },
        strength: { value: strength }, dashed: { value: dashed } } as never,
    });
  }

  /** Which workingsteps are drawn, and whether their rapids are. */
  show(steps: Set<number>, rapids: boolean): void {
    this.shownSteps = steps;
    this.rapids = rapids;
    this.showWays();
    this.ask();
  }

  /** While something moves on a slow machine the rough level is drawn, else the fine one. */
  private showLevels(): void {
    for (const [label, { mesh }] of this.parts) {
      const rough = this.roughPart.get(label);
      mesh.visible = !(rough && this.coarse < 1);
      if (rough) rough.visible = this.coarse < 1;
    }
    this.showCut();
    this.showWays();
  }

  private showWays(): void {
    for (const [step, w] of this.ways) {
      const rough = this.coarse < 1 ? this.roughWays.get(step) : undefined;
      const [cut, rapid] = [this.shownSteps.has(step), this.rapids && this.shownSteps.has(step)];
      w.cut.visible = cut && !rough;
      w.rapid.visible = rapid && !rough;
      const kept = this.roughWays.get(step);
      if (kept) {
        kept[0].visible = cut && rough !== undefined;
        kept[1].visible = rapid && rough !== undefined;
      }
    }
    this.shared.faded!.value = this.shownSteps.size && this.shared.mode!.value !== 2 ? 0.6 : 0;
  }

  setMode(mode: Mode): void {
    this.shared.mode!.value = { zones: 0, walls: 1, deviation: 2 }[mode];
    this.showWays();
    this.ask();
  }

  /** Cuts away what lies beyond a plane across an axis, at a share of the part; null: nothing. */
  cutAway(axis: 0 | 1 | 2 | null, share: number, flipped: boolean): void {
    if (axis === null) this.section.copy(NO_SECTION);
    else {
      const [low, high] = this.head!.bounds_mm;
      const at = low[axis] + share * (high[axis] - low[axis]);
      const n = new Vector3().setComponent(axis, flipped ? -1 : 1);
      this.section.set(n.x, n.y, n.z, flipped ? -at : at);
    }
    this.clip();
    this.ask();
  }

  private clip(): void {
    const s = this.section;
    this.plane.set(new Vector3(-s.x, -s.y, -s.z), s.w);
    this.renderer.localClippingEnabled = true;
    const planes = this.cutting ? [this.plane] : [];
    if (this.edges) (this.edges.material as LineBasicMaterial).clippingPlanes = planes;
    this.fillCut();
    for (const m of this.shine.children) ((m as Mesh).material as MeshBasicMaterial).clippingPlanes = planes;
  }

  /** The cut faces, of the finest level there is; while a slow machine draws the rough one the inside is seen instead. */
  private fillCut(): void {
    if (this.cutting) {
      this.cutPart.cut(this.section, [...this.parts.values()].map((p) => p.mesh), this.middle, this.size);
      this.cutStock_.cut(this.section, this.stock ? [this.stock.mesh] : [], this.middle, this.size);
    }
    this.showCut();
  }

  private showCut(): void {
    this.cutPart.group.visible = this.cutting && this.coarse === 1;
    this.cutStock_.group.visible = this.cutPart.group.visible && this.stock?.mesh.visible === true;
  }

  private get cutting(): boolean {
    return this.section.x !== 0 || this.section.y !== 0 || this.section.z !== 0;
  }


  // --- the stock in time

  private stock: Stock | null = null;
  private stockFed = false;
  private stockOn = true;

  get hasStock(): boolean {
    return this.head!.chunks.some((c) => c.kind === "field");
  }

  showStock(on: boolean): void {
    this.stockOn = on;
  }

  private addStock(entry: ChunkEntry, t: Table): void {
    this.stock = new Stock(entry, t, this.shared.section!, this.head!.budget_mm.scallop);
    this.stock.mesh.visible = false;
    this.scene.add(this.stock.mesh);
  }

  /** The ways that cut; once all of these are there. */
  private feedStock(stock: Stock): void {
    const head = this.head!;
    const courses: Course[] = [];
    head.steps.forEach((s, i) => {
      const w = this.ways.get(i);
      const tool = head.tools.find((x) => x.number === s.tool);
      if (w && tool) courses.push({ place: w.place, time: w.time, kind: w.kind, axis: w.axis, fixed: s.axis ?? [0, 0, 1], tool });
    });
    stock.follow(courses);
    this.stockFed = true;
  }

  private cutStock(seconds: number | null): void {
    const { stock } = this;
    if (!stock) return;
    stock.mesh.visible = seconds !== null && this.stockOn;
    this.showCut();
    if (!stock.mesh.visible) return;
    if (!this.stockFed) this.feedStock(stock);
    stock.time(seconds!);
  }

  // --- the tool in time -------------------------------------------------------------------------------------------

  /** Where the tip is at a second, and along which axis; null where the tool is on no way. */
  at(seconds: number): Place | null {
    const head = this.head!;
    let step = head.steps.findIndex((s) => seconds <= s.end_s);
    if (step < 0) step = head.steps.length - 1;
    while (step >= 0 && !this.ways.get(step)) step--;
    const w = this.ways.get(step);
    if (!w || w.time.length === 0) return null;
    let low = 0;
    let high = w.time.length - 1;
    while (low < high) {
      const mid = (low + high) >> 1;
      if (w.time[mid]! < seconds) low = mid + 1;
      else high = mid;
    }
    const row = low;
    const before = Math.max(0, row - 1);
    const span = w.time[row]! - w.time[before]!;
    const share = span > 0 && w.kind[row] !== 0 ? Math.min(1, Math.max(0, (seconds - w.time[before]!) / span)) : 1;
    const pick = (a: Float32Array): Vector3 =>
      new Vector3(...(a.subarray(3 * before, 3 * before + 3) as unknown as P3)).lerp(
        new Vector3(...(a.subarray(3 * row, 3 * row + 3) as unknown as P3)), share);
    const own = head.steps[step]!.axis;
    const axis = w.axis ? pick(w.axis).normalize() : new Vector3(...(own ?? [0, 0, 1]));
    return { step, place: pick(w.place), axis, line: w.line ? w.line[row]! : null };
  }

  /** Puts the tool where it is at a second, or to a place that is known better; null: no tool, all of the way as done. */
  time(seconds: number | null, known: Place | null = null): Place | null {
    this.shared.now!.value = seconds ?? Infinity;
    const here = seconds === null ? null : (known ?? this.at(seconds));
    this.tool.visible = here !== null;
    this.cutStock(here ? seconds : null);
    if (here) {
      const number = this.head!.steps[here.step]!.tool;
      if (number !== this.toolShown) this.makeTool(number);
      this.fade(known !== null);
      this.tool.position.copy(here.place);
      this.tool.quaternion.copy(new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), here.axis));
    }
    this.ask();
    return here;
  }

  /** At a finding one looks through the tool at the place. */
  private fade(on: boolean): void {
    for (const { material } of this.tool.children as Mesh<BufferGeometry, MeshLambertMaterial>[]) {
      const opacity = on ? Math.min(0.4, material.userData.opacity as number) : (material.userData.opacity as number);
      if (material.opacity === opacity) continue;
      material.opacity = opacity;
      material.transparent = opacity < 1;
      material.depthWrite = opacity === 1;
      material.needsUpdate = true;
    }
  }

  showHolder(on: boolean): void {
    this.holder = on;
    this.toolShown = -1;
  }

  private makeTool(number: number): void {
    this.toolShown = number;
    this.tool.clear();
    const shape = this.head!.tools.find((t) => t.number === number);
    const look: Record<string, [number, number]> = {
      "cutting part": [0xd9a62e, 1], neck: [0x9aa3ad, 1], shank: [0x7d8791, 0.85], holder: [0x6d7a87, 0.45],
    };
    for (const body of shape?.bodies ?? []) {
      if (body.kind === "holder" && !this.holder) continue;
      const p = body.profile.map(([r, z]) => new Vector2(r, z));
      const closed = [new Vector2(0, p[0]!.y), ...p, new Vector2(0, p[p.length - 1]!.y)];
      const g = new LatheGeometry(closed, 40);
      g.rotateX(Math.PI / 2); // its axis is Y
      const [colour, opacity] = look[body.kind] ?? [0x888888, 1];
      this.tool.add(new Mesh(g, new MeshLambertMaterial({ color: colour, transparent: opacity < 1, opacity, side: DoubleSide, depthWrite: opacity === 1, userData: { opacity } })));
    }
  }

  // --- where one looks from ------------------------------------------------------------------------------------------

  get middle(): Vector3 {
    const [low, high] = this.head!.bounds_mm;
    return new Vector3(...low).add(new Vector3(...high)).multiplyScalar(0.5);
  }

  get size(): number {
    const [low, high] = this.head!.bounds_mm;
    return new Vector3(...high).distanceTo(new Vector3(...low)) || 1;
  }

  private away(radius: number): number {
    const half = (this.camera.fov * Math.PI) / 360;
    return radius / Math.sin(Math.min(half, Math.atan(Math.tan(half) * this.camera.aspect)));
  }

  /** From how far all corners of the part are seen along a direction. */
  private awayOfAll(d: Vector3): number {
    const right = new Vector3().crossVectors(this.camera.up, d).normalize();
    const up = new Vector3().crossVectors(d, right);
    const half = 0.88 * Math.tan((this.camera.fov * Math.PI) / 360);
    const tall = half * Math.max(0.4, 1 - this.covered / (this.canvas.clientHeight || Infinity));
    const [low, high] = this.head!.bounds_mm;
    let far = 0.5 * this.size;
    for (let c = 0; c < 8; c++) {
      const o = new Vector3(...([0, 1, 2].map((k) => (c & (1 << k) ? high[k]! : low[k]!)) as P3)).sub(this.middle);
      far = Math.max(far, o.dot(d) + Math.max(Math.abs(o.dot(right)) / (half * this.camera.aspect), Math.abs(o.dot(up)) / tall));
    }
    return far;
  }

  fit(direction: P3 = [-0.55, -0.95, 0.9]): void {
    const d = new Vector3(...direction).normalize();
    this.controls.target.copy(this.middle);
    this.camera.position.copy(this.middle).addScaledVector(d, this.awayOfAll(d));
    this.camera.near = this.size / 500;
    this.camera.far = this.size * 60;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.ask();
  }

  /** Looks at a place from where it is seen, the present direction first. */
  lookAt(point: P3, radius: number): void {
    const p = new Vector3(...point);
    const now = this.camera.position.clone().sub(this.controls.target).normalize();
    const tries = [now];
    for (const up of [35, 60, 15, 85, -20])
      for (let k = 0; k < 12; k++) {
        const a = (k * Math.PI) / 6 + 0.3;
        const e = (up * Math.PI) / 180;
        tries.push(new Vector3(Math.cos(a) * Math.cos(e), Math.sin(a) * Math.cos(e), Math.sin(e)));
      }
    const far = this.away(radius);
    const free = tries.find((d) => {
      const caster = new Raycaster(p.clone().addScaledVector(d, 0.02 * radius + 0.05), d, 0, far);
      return this.cast(caster) === null;
    });
    const d = free ?? now;
    this.controls.target.copy(p);
    this.camera.position.copy(p).addScaledVector(d, far);
    this.controls.update();
    this.ask();
    this.onMove();
  }

  /** Turns (rad), moves (shares of the picture) or nears (factor) the camera; for keys. */
  nudge(turn: number, tilt: number, x: number, y: number, near: number): void {
    const t = this.controls.target;
    const off = this.camera.position.clone().sub(t);
    const r = off.length() * near;
    let polar = Math.acos(Math.min(1, Math.max(-1, off.z / off.length())));
    const azimuth = Math.atan2(off.y, off.x) + turn;
    polar = Math.min(Math.PI - 0.01, Math.max(0.01, polar + tilt));
    const right = new Vector3().setFromMatrixColumn(this.camera.matrix, 0).multiplyScalar(x * r);
    const up = new Vector3().setFromMatrixColumn(this.camera.matrix, 1).multiplyScalar(y * r);
    t.add(right).add(up);
    this.camera.position.set(Math.sin(polar) * Math.cos(azimuth), Math.sin(polar) * Math.sin(azimuth), Math.cos(polar))
      .multiplyScalar(r).add(t);
    this.controls.update();
    this.onMove();
  }

  get pose(): number[] {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray()].map((v) => Math.round(v * 100) / 100);
  }

  /** One from which nothing can be seen is not taken. */
  set pose(p: number[]) {
    const off = new Vector3(p[0]! - p[3]!, p[1]! - p[4]!, p[2]! - p[5]!).length();
    if (!(off > this.camera.near && off < this.camera.far)) return;
    this.camera.position.set(p[0]!, p[1]!, p[2]!);
    this.controls.target.set(p[3]!, p[4]!, p[5]!);
    this.controls.update();
    this.ask();
  }

  // --- what is under the pointer --------------------------------------------------------------------------------------

  /** The first facet of the part on a ray that the section leaves; `rough`: of the first level, many times faster. */
  private cast(caster: Raycaster, rough = false): Intersection | null {
    const meshes = [...this.parts].map(([label, { mesh }]) => (rough ? (this.roughPart.get(label) ?? mesh) : mesh));
    return caster.intersectObjects(meshes, false).find((hit) => this.kept(hit.point)) ?? null;
  }

  /** mm that stock stands out of the part where a ray meets it. */
  private spareAt(hit: Intersection): number {
    const spares = (hit.object as Mesh).geometry.attributes.spare as BufferAttribute;
    const { a, b, c } = hit.face!;
    return hit.barycoord!.x * spares.getX(a) + hit.barycoord!.y * spares.getX(b) + hit.barycoord!.z * spares.getX(c);
  }

  /** Whether a ray is in a body where it comes through the section: it leaves the body more often than it enters it. */
  private inside(caster: Raycaster, hits: Intersection[]): boolean {
    return this.cutting && hits.reduce((sum, h) => sum + Math.sign(h.face!.normal.clone().transformDirection(h.object.matrixWorld).dot(caster.ray.direction)), 0) > 0;
  }

  /** The place of part or stock that is seen under a point of the page, CSS pixels. */
  pick(x: number, y: number): Hit | null {
    this.camera.updateMatrixWorld(); // it may have moved since the last picture
    // a ray through an edge may slip between its facets, as in the middle of an even part
    return this.pickAt(x, y) ?? this.pickAt(x + 0.31, y + 0.17) ?? this.pickAt(x - 0.17, y - 0.31);
  }

  private pickAt(x: number, y: number): Hit | null {
    const box = this.canvas.getBoundingClientRect();
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height), this.camera);
    const onPart = caster.intersectObjects([...this.parts.values()].map((p) => p.mesh), false).filter((h) => this.kept(h.point));
    const onStock = this.stock?.mesh.visible ? caster.intersectObject(this.stock.mesh, false).filter((h) => this.kept(h.point)) : [];
    const none = { face: -1, label: -1, left: 0, judged: 0 };
    const inPart = this.inside(caster, onPart);
    if (inPart || this.inside(caster, onStock)) {
      const point = caster.ray.intersectPlane(this.plane, new Vector3());
      if (point) return { ...none, point, cut: true, spare: inPart ? null : 0 };
    }
    const hit = onPart[0];
    const stock = onStock.find((h) => this.spareAt(h) >= this.stock!.least);
    if (stock && (!hit || stock.distance < hit.distance)) return { ...none, point: stock.point, cut: false, spare: this.spareAt(stock) };
    if (!hit?.face) return null;
    const mesh = hit.object as Mesh;
    const g = mesh.geometry;
    const corner = [hit.face.a, hit.face.b, hit.face.c].reduce((best, c) =>
      hit.point.distanceToSquared(new Vector3().fromBufferAttribute(g.attributes.position as BufferAttribute, c)) <
      hit.point.distanceToSquared(new Vector3().fromBufferAttribute(g.attributes.position as BufferAttribute, best)) ? c : best);
    return {
      point: hit.point, cut: false, spare: null, face: (mesh.userData.face as Int32Array)[corner]!, label: mesh.userData.label as number,
      left: (g.attributes.left_ as BufferAttribute).getX(corner), judged: (g.attributes.judged as BufferAttribute).getX(corner),
    };
  }

  /** Where a place is drawn, CSS pixels of the canvas; null where it is behind the viewer. */
  screen(p: Vector3): { x: number; y: number } | null {
    const q = p.clone().project(this.camera);
    if (q.z > 1) return null;
    return { x: ((q.x + 1) / 2) * this.canvas.clientWidth, y: ((1 - q.y) / 2) * this.canvas.clientHeight };
  }

  /** Whether the section leaves a place. */
  kept(p: Vector3): boolean {
    return this.section.x * p.x + this.section.y * p.y + this.section.z * p.z <= this.section.w;
  }

  /** Whether nothing of the part stands before a place, as far as the rough level tells. */
  free(p: Vector3): boolean {
    const d = this.camera.position.clone().sub(p);
    const far = d.length();
    d.normalize();
    return this.cast(new Raycaster(p.clone().addScaledVector(d, 0.02 * this.size), d, 0, far), true) === null;
  }

  /** A straight line between two places that the part does not hide; null takes it away. */
  rule(a: Vector3 | null, b: Vector3 | null): void {
    this.marks.clear();
    if (a && b) {
      const g = new BufferGeometry().setFromPoints([a, b]);
      const line = new LineSegments(g, new LineBasicMaterial({ color: 0xe0007a, depthTest: false }));
      line.renderOrder = 9;
      this.marks.add(line);
    }
    this.ask();
  }
}
