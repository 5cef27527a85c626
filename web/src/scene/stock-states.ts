// The stock at any second: the last state of the verifier before it, cut further by the tool along the path that is drawn.
import { sweep, type Cutter, type Grid } from "./distance-field";
import type { ChunkEntry, Table, ToolShape } from "../shared/view-file";

/**
 * Rows of a path: places in the setup frame, mm; seconds; kinds (2: a feed move leads here); axes, null if they do not change,
 * in which case `fixed` is the axis.
 */
export interface CutterPath {
  place: Float32Array;
  time: Float32Array;
  kind: Uint8Array;
  axis: Float32Array | null;
  fixed: [number, number, number];
  tool: ToolShape;
}

const CUT = 2;

export class StockStates {
  readonly grid: Grid;
  readonly part: Float32Array;
  readonly values: Float32Array;
  /** Seconds of the states of the verifier. */
  readonly ended: Float64Array;
  private readonly first: Int8Array;
  private readonly base: Int8Array;
  private readonly unit: number;
  private readonly begins: Int32Array;
  private readonly node: Int32Array;
  private readonly value: Int32Array;
  private readonly turn: number[];
  private paths: CutterPath[] = [];
  private state = 0; // number of the state that `base` holds
  private until = 0; // second that `values` hold

  constructor(entry: ChunkEntry, t: Table) {
    const [nx, ny, nz] = entry.shape!;
    this.grid = { nx: nx, ny: ny, nz: nz, step: entry.step_mm!, origin: entry.origin_mm! };
    this.unit = entry.step_mm! / entry.levels!;
    this.turn = entry.rotation!;
    this.first = Int8Array.from(t.first!);
    this.base = this.first.slice();
    this.part = Float32Array.from(t.part!, (v) => v * this.unit);
    this.values = Float32Array.from(this.first, (v) => v * this.unit);
    this.ended = Float64Array.from(t.ended!, (ms) => ms / 1000);
    [this.begins, this.node, this.value] = [t.begins!, t.node!, t.value!];
  }

  follow(paths: CutterPath[]): void {
    this.paths = paths;
    this.until = Infinity; // what was cut along other paths does not count
  }

  /** Brings `values` to a second. */
  time(seconds: number): void {
    let k = 0;
    while (k < this.ended.length && this.ended[k]! <= seconds + 1e-6) k++;
    if (k !== this.state || seconds < this.until) {
      if (k < this.state) {
        this.base.set(this.first);
        this.state = 0;
      }
      for (let n = this.begins[this.state]!; n < this.begins[k]!; n++) this.base[this.node[n]!] = this.value[n]!;
      this.state = k;
      for (let n = 0; n < this.base.length; n++) this.values[n] = this.base[n]! * this.unit;
      this.until = k > 0 ? this.ended[k - 1]! : 0;
    }
    if (k < this.ended.length) for (const c of this.paths) this.along(c, this.until, seconds);
    this.until = Math.max(this.until, seconds);
  }

  private along(c: CutterPath, from: number, to: number): void {
    const n = c.time.length;
    if (n < 2 || c.time[n - 1]! <= from || c.time[0]! > to) return;
    const tool = cutterOf(c.tool);
    let low = 1;
    for (let high = n; low < high; ) {
      const mid = (low + high) >> 1;
      if (c.time[mid]! <= from) low = mid + 1;
      else high = mid;
    }
    for (let row = low; row < n && c.time[row - 1]! <= to; row++) {
      if (c.kind[row] !== CUT) continue;
      const [t0, t1] = [c.time[row - 1]!, c.time[row]!];
      const share = (t: number, none: number): number => (t1 > t0 ? Math.min(1, Math.max(0, (t - t0) / (t1 - t0))) : none);
      const [a, b] = [share(from, 0), share(to, 1)];
      sweep(this.grid, this.values, tool, this.here(c.place, row, a), this.here(c.place, row, b), this.axis(c, row, a), this.axis(c, row, b));
    }
  }

  /** A vector between row - 1 and row, at a share of the path, in the frame of the grid. */
  private here(rows: Float32Array, row: number, share: number): [number, number, number] {
    const p = 3 * (row - 1);
    const at = (c: number): number => rows[p + c]! + share * (rows[p + 3 + c]! - rows[p + c]!);
    return this.turned(at(0), at(1), at(2));
  }

  private axis(c: CutterPath, row: number, share: number): [number, number, number] {
    return c.axis ? this.here(c.axis, row, share) : this.turned(...c.fixed);
  }

  private turned(x: number, y: number, z: number): [number, number, number] {
    const r = this.turn;
    return [r[0]! * x + r[1]! * y + r[2]! * z, r[3]! * x + r[4]! * y + r[5]! * z, r[6]! * x + r[7]! * y + r[8]! * z];
  }
}

/** The cutting part from its profile: points (radius, height) from the tip to the end of the flutes. */
export function cutterOf(tool: ToolShape): Cutter {
  const profile = tool.bodies[0]!.profile;
  const length = profile[profile.length - 1]![1];
  if (tool.profile_radius_mm) {
    const radius = 0.5 * tool.diameter_mm;
    return { radius, corner: 0, length, taper: 0, outline: profile };
  }
  if (tool.taper_deg) {
    const radius = 0.5 * tool.diameter_mm; // of the end; the second point is where its flat ends
    return { radius, corner: radius - profile[1]![0], length, taper: (tool.taper_deg * Math.PI) / 180 };
  }
  const radius = Math.max(...profile.map(([r]) => r));
  const full = profile.find(([r]) => r >= radius - 1e-6)!;
  return { radius, corner: Math.min(radius, full[1]), length, taper: 0 };
}
