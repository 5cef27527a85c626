// The stock as heights over a grid, cut away by the tool as time goes. To look at only: the proof has a finer model.
import { BufferAttribute, BufferGeometry, DoubleSide, GLSL3, Matrix4, Mesh, ShaderMaterial } from "three";
import type { ChunkEntry, Table, ToolShape } from "./viewfile";

const VERTEX = /* glsl */ `
in float spare; out vec3 vPlace; out vec3 vEye; out float vSpare;
void main() {
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  vPlace = (modelMatrix * vec4(position, 1.0)).xyz; vEye = eye.xyz; vSpare = spare;
  gl_Position = projectionMatrix * eye;
}`;
const FRAGMENT = /* glsl */ `
precision highp float;
in vec3 vPlace; in vec3 vEye; in float vSpare; out vec4 outColour;
uniform vec4 section; uniform float least;
void main() {
  if (dot(section.xyz, vPlace) > section.w) discard;
  if (vSpare < least) discard; // here the part itself is seen
  vec3 n = normalize(cross(dFdx(vEye), dFdy(vEye)));
  float shade = 0.55 + 0.30 * abs(dot(n, normalize(vec3(-0.35, 0.55, 0.75)))) + 0.18 * abs(n.z);
  outColour = vec4(vec3(0.80, 0.72, 0.58) * shade, 1.0);
}`;

/** Rows of a way: places in the setup frame, seconds, kinds (0: a way begins here). */
export interface Course {
  place: Float32Array;
  time: Float32Array;
  kind: Uint8Array;
  tool: ToolShape;
}

interface Kept {
  course: number;
  row: number;
  heights: Float32Array;
}

const KEEP_EVERY = 2_500_000; // nodes looked at between two states that are kept
const MOST_KEPT = 40;

export class Stock {
  readonly mesh: Mesh;
  private readonly blank: Float32Array;
  private readonly part: Float32Array;
  private heights: Float32Array;
  private readonly nx: number;
  private readonly ny: number;
  private readonly step: number;
  private readonly x0: number;
  private readonly y0: number;
  private readonly foot: number;
  private readonly turn: number[];
  private courses: Course[] = [];
  private at = { course: 0, row: 1 };
  private kept: Kept[] = [];
  private worked = 0;
  private until = 0; // seconds it stands at
  private lowered = new Map<number, (r2: number) => number>();

  /** slack : mm, what the ways are drawn by; the tool is taken as so much wider, and stock so much over the part as gone */
  constructor(entry: ChunkEntry, t: Table, section: { value: unknown }, private readonly slack: number) {
    this.nx = entry.nx!;
    this.ny = entry.ny!;
    this.step = entry.step_mm!;
    this.x0 = entry.x0_mm!;
    this.y0 = entry.y0_mm!;
    this.foot = entry.foot_mm!;
    this.turn = entry.rotation!;
    const heights = (column: Int32Array): Float32Array => Float32Array.from(column, (v) => this.foot + Math.max(0, v - 1) * entry.unit_mm!);
    this.blank = heights(t.blank!);
    this.part = heights(t.part!);
    this.heights = this.blank.slice();
    const n = this.nx * this.ny;
    const g = new BufferGeometry();
    g.setAttribute("position", new BufferAttribute(new Float32Array(3 * n), 3));
    g.setAttribute("spare", new BufferAttribute(new Float32Array(n), 1));
    const index = new Uint32Array(6 * (this.nx - 1) * (this.ny - 1));
    let k = 0;
    for (let j = 0; j + 1 < this.ny; j++)
      for (let i = 0; i + 1 < this.nx; i++) {
        const a = j * this.nx + i;
        index.set([a, a + 1, a + this.nx + 1, a, a + this.nx + 1, a + this.nx], k);
        k += 6;
      }
    g.setIndex(new BufferAttribute(index, 1));
    const material = new ShaderMaterial({ glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, side: DoubleSide,
      polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2, uniforms: { section, least: { value: 0.02 + slack } } as never });
    this.mesh = new Mesh(g, material);
    this.mesh.frustumCulled = false;
    const r = this.turn;
    // rows of the rotation are the axes of the grid in the setup frame
    this.mesh.applyMatrix4(new Matrix4().set(r[0]!, r[3]!, r[6]!, 0, r[1]!, r[4]!, r[7]!, 0, r[2]!, r[5]!, r[8]!, 0, 0, 0, 0, 1));
  }

  /** What runs on this grid, in order; begins anew. */
  follow(courses: Course[]): void {
    this.courses = courses;
    this.kept = [];
    this.worked = 0;
    this.reset();
  }

  private reset(): void {
    this.heights.set(this.blank);
    this.at = { course: 0, row: 1 };
    this.until = 0;
  }

  /** The stock at a second, drawn. */
  time(seconds: number): void {
    if (this.until > seconds) {
      const back = [...this.kept].reverse().find((k) => (this.courses[k.course]!.time[k.row - 1] ?? 0) <= seconds);
      if (back) {
        this.heights.set(back.heights);
        this.at = { course: back.course, row: back.row };
      } else this.reset();
    }
    this.until = seconds;
    for (; this.at.course < this.courses.length; this.at = { course: this.at.course + 1, row: 1 }) {
      const c = this.courses[this.at.course]!;
      if ((c.time[0] ?? 0) > seconds) break;
      const lower = this.shapeOf(c.tool);
      let row = this.at.row;
      for (; row < c.time.length; row++) {
        if (c.kind[row] === 0) continue;
        const from = c.time[row - 1]!;
        const to = c.time[row]!;
        if (from > seconds) break;
        const share = to > seconds && to > from ? (seconds - from) / (to - from) : 1;
        this.cut(c, row, share, lower);
        if (share < 1) break;
        if (this.worked > KEEP_EVERY * (this.kept.length + 1) && this.kept.length < MOST_KEPT) this.kept.push({ course: this.at.course, row: row + 1, heights: this.heights.slice() });
      }
      this.at.row = row;
      if (row < c.time.length) break;
    }
    this.draw();
  }

  /** Height of the cutting part over its tip at a distance squared from the axis; NaN outside. */
  private shapeOf(tool: ToolShape): (r2: number) => number {
    const known = this.lowered.get(tool.number);
    if (known) return known;
    const profile = tool.bodies[0]!.profile;
    const radius = Math.max(...profile.map(([r]) => r));
    const corner = Math.max(...profile.filter(([r], i) => r >= radius - 1e-6 && i < profile.length - 1).map(([, z]) => z), 0);
    const flat = radius - corner;
    const shape = (r2: number): number => {
      if (r2 <= flat * flat) return 0;
      const out = Math.sqrt(r2) - flat;
      return out > corner + this.slack ? Number.NaN : out > corner ? corner : corner - Math.sqrt(Math.max(0, corner * corner - out * out));
    };
    this.lowered.set(tool.number, shape);
    return shape;
  }

  private cut(c: Course, row: number, share: number, shape: (r2: number) => number): void {
    const r = this.turn;
    const p = c.place;
    const here = (i: number): [number, number, number] => {
      const [x, y, z] = [p[3 * i]!, p[3 * i + 1]!, p[3 * i + 2]!];
      return [r[0]! * x + r[1]! * y + r[2]! * z, r[3]! * x + r[4]! * y + r[5]! * z, r[6]! * x + r[7]! * y + r[8]! * z];
    };
    const [ax, ay, az] = here(row - 1);
    const [ex, ey, ez] = here(row);
    const [bx, by, bz] = [ax + share * (ex - ax), ay + share * (ey - ay), az + share * (ez - az)];
    const radius = 0.5 * c.tool.diameter_mm + this.slack;
    const length = Math.hypot(bx - ax, by - ay);
    const steps = Math.max(1, Math.ceil(length / Math.max(this.step, 0.15 * radius)));
    const first = Math.max(0, Math.ceil((Math.min(ax, bx) - radius - this.x0) / this.step));
    if (first >= this.nx) return;
    for (let s = length > 0 || row === 1 ? 0 : steps; s <= steps; s++) {
      const x = ax + ((bx - ax) * s) / steps;
      const y = ay + ((by - ay) * s) / steps;
      const z = az + ((bz - az) * s) / steps;
      const i0 = Math.max(0, Math.ceil((x - radius - this.x0) / this.step));
      const i1 = Math.min(this.nx - 1, Math.floor((x + radius - this.x0) / this.step));
      const j0 = Math.max(0, Math.ceil((y - radius - this.y0) / this.step));
      const j1 = Math.min(this.ny - 1, Math.floor((y + radius - this.y0) / this.step));
      this.worked += Math.max(0, i1 - i0 + 1) * Math.max(0, j1 - j0 + 1);
      for (let j = j0; j <= j1; j++) {
        const dy = this.y0 + j * this.step - y;
        for (let i = i0; i <= i1; i++) {
          const k = j * this.nx + i;
          if (this.heights[k]! <= z) continue;
          const dx = this.x0 + i * this.step - x;
          const h = z + shape(dx * dx + dy * dy);
          if (h < this.heights[k]!) this.heights[k] = h;
        }
      }
    }
  }

  private draw(): void {
    const g = this.mesh.geometry;
    const place = g.attributes.position!.array as Float32Array;
    const spare = g.attributes.spare!.array as Float32Array;
    for (let j = 0, k = 0; j < this.ny; j++)
      for (let i = 0; i < this.nx; i++, k++) {
        const h = Math.max(this.foot, this.heights[k]!);
        place[3 * k] = this.x0 + i * this.step;
        place[3 * k + 1] = this.y0 + j * this.step;
        place[3 * k + 2] = h;
        spare[k] = h - Math.max(this.foot, this.part[k]!);
      }
    g.attributes.position!.needsUpdate = true;
    g.attributes.spare!.needsUpdate = true;
  }
}
