// Places of the part: from the integers of view.bin to mm, and the box around the part.
import { Vector3 } from "three";
import type { Table, ViewHead } from "../shared/view-file";

export type P3 = [number, number, number];

/** The bounding box of the part, mm; `size` is its diagonal. */
export interface Bounds {
  low: P3;
  high: P3;
  middle: Vector3;
  size: number;
}

export function boundsOf(head: ViewHead): Bounds {
  const [low, high] = head.bounds_mm;
  const [a, b] = [new Vector3(...low), new Vector3(...high)];
  return { low, high, middle: a.clone().add(b).multiplyScalar(0.5), size: b.distanceTo(a) || 1 };
}

/** The column `place` of a table in mm, x y z behind each other; `grid` is the length of one integer step, mm. */
export function placesOf(table: Table, low: P3, grid: number): Float32Array {
  const [x, y, z] = low;
  const from = table.place!;
  const out = new Float32Array(from.length);
  for (let i = 0; i < from.length; i += 3) {
    out[i] = x + grid * from[i]!;
    out[i + 1] = y + grid * from[i + 1]!;
    out[i + 2] = z + grid * from[i + 2]!;
  }
  return out;
}
