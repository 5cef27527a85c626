// The tool paths of the workingsteps: their lines, and the position of the tool at any second.
import { BufferAttribute, BufferGeometry, Color, GLSL3, Group, LineSegments, ShaderMaterial, Vector3 } from "three";
import type { ChunkEntry, Table, ViewHead } from "../shared/view-file";
import { RAPID, toolColour, type RGB } from "./colours";
import { placesOf, type P3 } from "./coordinates";
import type { Section } from "./section";
import { PATH_FRAGMENT, PATH_VERTEX } from "./shaders";
import type { CutterPath } from "./stock-states";

const BREAK = 0; // kind of a row that no move leads to
const CUT = 2; // kind of a row that a feed move leads to

/** Position of the tool: its tip, its axis, and the line of the program that leads there. */
export interface ToolPosition {
  step: number;
  place: Vector3;
  axis: Vector3;
  line: number | null;
}

/** Lines of one workingstep in one level of detail. */
interface PathLines {
  cut: LineSegments;
  rapid: LineSegments;
}

/** Path of one workingstep: rows of the finest level, with what draws them. */
interface StepPath extends PathLines {
  lod: number;
  place: Float32Array;
  time: Float32Array;
  kind: Uint8Array;
  axis: Float32Array | null;
  line: Int32Array | null;
}

export class Paths {
  readonly group = new Group();
  private head: ViewHead | null = null;
  private readonly steps = new Map<number, StepPath>();
  private readonly rough = new Map<number, PathLines>();
  private readonly seconds = { value: Infinity }; // for shaders: what comes later is faint
  private shown = new Set<number>();
  private rapids = false;

  constructor(private readonly section: Section) {}

  begin(head: ViewHead): void {
    this.head = head;
  }

  add(entry: ChunkEntry, t: Table): void {
    const head = this.head!;
    const step = entry.step!;
    const old = this.steps.get(step);
    if (old && old.lod > entry.lod) return;
    const place = placesOf(t, head.low_mm, head.path_grid_mm);
    const time = Float32Array.from(t.time!, (ms) => ms / 1000);
    const axis = t.axis ? Float32Array.from(t.axis, (v) => v / head.axis_unit) : null;
    const lines = this.linesOf(step, place, time, t.kind!);
    if (old) {
      [old.cut.material, old.rapid.material] = [lines.cut.material, lines.rapid.material];
      this.rough.set(step, { cut: old.cut, rapid: old.rapid });
    }
    this.group.add(lines.cut, lines.rapid);
    this.steps.set(step, { lod: entry.lod, place, time, kind: Uint8Array.from(t.kind!), axis, line: t.line ?? null, ...lines });
  }

  /** Which workingsteps are drawn, and whether their rapids are. */
  show(steps: Set<number>, rapids: boolean): void {
    this.shown = steps;
    this.rapids = rapids;
  }

  get anyShown(): boolean {
    return this.shown.size > 0;
  }

  showLevel(rough: boolean): void {
    for (const [step, fine] of this.steps) {
      const coarse = this.rough.get(step);
      const drawCoarse = rough && coarse !== undefined;
      const [cut, rapid] = [this.shown.has(step), this.rapids && this.shown.has(step)];
      fine.cut.visible = cut && !drawCoarse;
      fine.rapid.visible = rapid && !drawCoarse;
      if (coarse) {
        coarse.cut.visible = cut && drawCoarse;
        coarse.rapid.visible = rapid && drawCoarse;
      }
    }
  }

  /** Makes what lies behind a second faint; null: nothing. */
  setTime(seconds: number | null): void {
    this.seconds.value = seconds ?? Infinity;
  }

  /** Position of the tool at a second; null if there is no path. */
  at(seconds: number): ToolPosition | null {
    const head = this.head!;
    let step = head.steps.findIndex((s) => seconds <= s.end_s);
    if (step < 0) step = head.steps.length - 1;
    while (step >= 0 && !this.steps.get(step)) step--;
    const path = this.steps.get(step);
    if (!path || path.time.length === 0) return null;
    const row = firstRowNotBefore(path.time, seconds);
    const before = Math.max(0, row - 1);
    const span = path.time[row]! - path.time[before]!;
    const share = span > 0 && path.kind[row] !== BREAK ? Math.min(1, Math.max(0, (seconds - path.time[before]!) / span)) : 1;
    const vector = (a: Float32Array, i: number): Vector3 => new Vector3(...(a.subarray(3 * i, 3 * i + 3) as unknown as P3));
    const between = (a: Float32Array): Vector3 => vector(a, before).lerp(vector(a, row), share);
    const axis = path.axis ? between(path.axis).normalize() : new Vector3(...(head.steps[step]!.axis ?? [0, 0, 1]));
    return { step, place: between(path.place), axis, line: path.line ? path.line[row]! : null };
  }

  /** The paths in the order of machining, with their tools, as the stock is cut along them. */
  get cutterPaths(): CutterPath[] {
    const head = this.head!;
    return head.steps.flatMap((s, i) => {
      const path = this.steps.get(i);
      const tool = head.tools.find((x) => x.number === s.tool);
      return path && tool ? [{ place: path.place, time: path.time, kind: path.kind, axis: path.axis, fixed: s.axis ?? [0, 0, 1], tool }] : [];
    });
  }

  private linesOf(step: number, place: Float32Array, time: Float32Array, kind: Int32Array): PathLines {
    const cuts: number[] = [];
    const moves: number[] = [];
    for (let i = 1; i < kind.length; i++) if (kind[i] !== BREAK) (kind[i] === CUT ? cuts : moves).push(i - 1, i);
    const at = new BufferAttribute(place, 3);
    const when = new BufferAttribute(time, 1);
    const geometry = (index: number[]): BufferGeometry => {
      const out = new BufferGeometry();
      out.setAttribute("position", at);
      out.setAttribute("time", when);
      out.setIndex(new BufferAttribute(Uint32Array.from(index), 1));
      return out;
    };
    const { tool, operation } = this.head!.steps[step]!;
    const colour = toolColour(Math.max(0, this.head!.tools.findIndex((x) => x.number === tool)));
    return {
      cut: new LineSegments(geometry(cuts), this.materialOf(colour, operation === "roughing" ? 0.45 : 0.85, false)),
      rapid: new LineSegments(geometry(moves), this.materialOf(RAPID, 0.7, true)),
    };
  }

  private materialOf(colour: RGB, strength: number, dashed: boolean): ShaderMaterial {
    return new ShaderMaterial({
      glslVersion: GLSL3, vertexShader: PATH_VERTEX, fragmentShader: PATH_FRAGMENT, transparent: true, depthWrite: false,
      uniforms: { section: this.section.uniform, now: this.seconds, colour: { value: new Color(...colour) },
        strength: { value: strength }, dashed: { value: dashed ? 1 : 0 } },
    });
  }
}

/** The first row whose second is not before a second; the last row if there is none. */
function firstRowNotBefore(time: Float32Array, seconds: number): number {
  let low = 0;
  let high = time.length - 1;
  while (low < high) {
    const mid = (low + high) >> 1;
    if (time[mid]! < seconds) low = mid + 1;
    else high = mid;
  }
  return low;
}
