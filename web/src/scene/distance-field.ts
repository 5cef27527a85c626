// The stock as a distance field on a grid: cut by a tool, and its surface. It needs no graphics, so tests run it alone.

/** Node (i, j, k) is number (i ny + j) nz + k and stands at origin + (i, j, k) step; values in mm, above zero in stock. */
export interface Grid {
  nx: number;
  ny: number;
  nz: number;
  step: number;
  origin: [number, number, number];
}

/**
 * Cutting part of a tool: radius of its end, corner radius and flute length, mm; angle between side and axis, rad.
 * Of a lens or barrel its outline counts instead: radius and height of points from the tip up, mm.
 */
export interface Cutter {
  radius: number;
  corner: number;
  length: number;
  taper: number;
  outline?: [number, number][];
}

type Three = ArrayLike<number>;

/** Lowers nodes to their distance from a tool whose tip goes straight from `a` to `b` while its axis turns from `u` to `v`. */
export function sweep(g: Grid, values: Float32Array, tool: Cutter, a: Three, b: Three, u: Three, v: Three): void {
  const tip = Math.hypot(b[0]! - a[0]!, b[1]! - a[1]!, b[2]! - a[2]!);
  const turn = Math.hypot(v[0]! - u[0]!, v[1]! - u[1]!, v[2]! - u[2]!) * tool.length;
  const steps = Math.max(1, Math.ceil((tip + turn) / Math.max(0.3 * tool.radius, 0.25 * g.step)));
  for (let s = 0; s <= steps; s++) {
    const f = s / steps;
    const at = (p: Three, q: Three, c: number): number => p[c]! + f * (q[c]! - p[c]!);
    const [x, y, z] = [at(u, v, 0), at(u, v, 1), at(u, v, 2)];
    const size = Math.hypot(x, y, z) || 1;
    place(g, values, tool, at(a, b, 0) - g.origin[0], at(a, b, 1) - g.origin[1], at(a, b, 2) - g.origin[2], x / size, y / size, z / size);
  }
}

/** The same for a tool at rest: its tip in mm from node 0, its axis a unit vector. */
function place(g: Grid, values: Float32Array, tool: Cutter, px: number, py: number, pz: number, ax: number, ay: number, az: number): void {
  const { step: h, nx, ny, nz } = g;
  const { radius, corner, length } = tool;
  const flat = radius - corner;
  const [sin, cos] = [Math.sin(tool.taper), Math.cos(tool.taper)];
  const edges = tool.outline ? normals(tool.outline) : null;
  const widest = edges ? radius : flat + (corner + Math.max(0, length - corner) * sin) / cos; // from the middle of the corner along the side
  const range = (p: number, a: number, n: number): [number, number] => {
    const aside = widest * Math.sqrt(Math.max(0, 1 - a * a)) + h;
    return [Math.max(0, Math.ceil((Math.min(p, p + length * a) - aside) / h)), Math.min(n - 1, Math.floor((Math.max(p, p + length * a) + aside) / h))];
  };
  const [i0, i1] = range(px, ax, nx);
  const [j0, j1] = range(py, ay, ny);
  const [k0, k1] = range(pz, az, nz);
  for (let i = i0; i <= i1; i++) {
    const x = i * h - px;
    for (let j = j0; j <= j1; j++) {
      const y = j * h - py;
      const xy = x * x + y * y;
      const base = x * ax + y * ay;
      for (let k = k0, n = (i * ny + j) * nz + k0; k <= k1; k++, n++) {
        const now = values[n]!;
        if (now <= -h) continue;
        const z = k * h - pz;
        const up = base + z * az;
        if (up - length >= now || -up >= now) continue;
        const r2 = Math.max(0, xy + z * z - up * up);
        const wide = widest + Math.max(now, now / cos);
        if (wide <= 0 || r2 >= wide * wide) continue;
        const r = Math.sqrt(r2);
        const [out, over] = [r - flat, up - corner]; // from the middle of the corner
        const end = edges ? farthest(edges, r, up) : out > 0 && out * sin + over * cos < 0 ? Math.hypot(out, over) - corner : Math.max(out * cos - over * sin - corner, -up);
        const d = Math.max(end, up - length, -h);
        if (d < now) values[n] = d;
      }
    }
  }
}

/** Edges of a convex outline from the tip up: outward unit normal (radius, height) and distance from the tip along it. */
function normals(outline: [number, number][]): [number, number, number][] {
  const out: [number, number, number][] = [];
  for (let k = 1; k < outline.length; k++) {
    const [[r0, h0], [r1, h1]] = [outline[k - 1]!, outline[k]!];
    const size = Math.hypot(r1 - r0, h1 - h0);
    if (size > 1e-9) out.push([(h1 - h0) / size, (r0 - r1) / size, (r0 * (h1 - h0) + h0 * (r0 - r1)) / size]);
  }
  return out;
}

/** Largest distance of a place from the edges: negative inside. */
function farthest(edges: [number, number, number][], r: number, up: number): number {
  let most = -Infinity;
  for (const [a, b, c] of edges) most = Math.max(most, a * r + b * up - c);
  return most;
}

/** A surface. `spare`: how far each vertex lies outside the part, mm. The arrays are longer than what is used of them. */
export interface Net {
  vertices: number;
  triangles: number;
  place: Float32Array;
  normal: Float32Array;
  spare: Float32Array;
  index: Uint32Array;
}

export function noNet(): Net {
  return { vertices: 0, triangles: 0, place: new Float32Array(0), normal: new Float32Array(0), spare: new Float32Array(0), index: new Uint32Array(0) };
}

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7] as const;
const EDGES: [number, number, number][] = []; // corner, corner, axis; corners are numbered 4 i + 2 j + k
for (const c of CORNERS) for (const e of [0, 1, 2]) if (!(c & (4 >> e))) EDGES.push([c, c | (4 >> e), e]);

/**
 * The surface of the stock by surface nets, as `net_vertices` and `net_faces` of the verifier make it: a vertex in each cell
 * whose nodes differ, at the mean of where its edges cross zero, and two triangles across each edge of the grid that crosses
 * zero. The nodes of the border are outside.
 */
export function surface(g: Grid, values: Float32Array, part: Float32Array, old: Net): Net {
  const { number, count } = numberedCells(g, values);
  const net = room(old, count);
  net.vertices = count;
  placeVertices(g, values, part, number, net);
  joinVertices(g, values, number, net);
  return net;
}

/** Numbers the cells whose nodes differ, from 0; -1 for all others. */
function numberedCells({ nx, ny, nz }: Grid, values: Float32Array): { number: Int32Array; count: number } {
  const column = nz;
  const slab = ny * nz;
  const number = new Int32Array(nx * slab).fill(-1);
  let count = 0;
  for (let i = 0; i + 1 < nx; i++)
    for (let j = 0; j + 1 < ny; j++) {
      let low = 0;
      for (let k = 0, n = i * slab + j * column; k < nz; k++, n++) {
        const high = (values[n]! > 0 ? 1 : 0) | (values[n + column]! > 0 ? 2 : 0) | (values[n + slab]! > 0 ? 4 : 0) | (values[n + slab + column]! > 0 ? 8 : 0);
        if (k > 0 && low + high !== 0 && (low & high) !== 15) number[n - 1] = count++;
        low = high;
      }
    }
  return { number, count };
}

/** Places, normals and spares of the vertices. */
function placeVertices(g: Grid, values: Float32Array, part: Float32Array, number: Int32Array, net: Net): void {
  const { nx, ny, nz, step: h } = g;
  const offset = CORNERS.map((c) => (c & 4 ? ny * nz : 0) + (c & 2 ? nz : 0) + (c & 1));
  const v = new Float64Array(8);
  for (let i = 0, n = 0; i + 1 < nx; i++)
    for (let j = 0; j < ny; j++)
      for (let k = 0; k < nz; k++, n++) {
        const to = number[n]!;
        if (to < 0) continue;
        for (const c of CORNERS) v[c] = values[n + offset[c]!]!;
        let [m, x, y, z, out] = [0, 0, 0, 0, 0];
        let [gx, gy, gz] = [0, 0, 0];
        for (const [c, d, e] of EDGES) {
          const change = v[d]! - v[c]!;
          if (e === 0) gx += change;
          else if (e === 1) gy += change;
          else gz += change;
          if (v[c]! > 0 === v[d]! > 0) continue;
          const f = -v[c]! / change;
          x += (c >> 2) + (e === 0 ? f : 0);
          y += ((c >> 1) & 1) + (e === 1 ? f : 0);
          z += (c & 1) + (e === 2 ? f : 0);
          const p = part[n + offset[c]!]!;
          out -= p + f * (part[n + offset[d]!]! - p);
          m++;
        }
        const size = Math.hypot(gx, gy, gz) || 1;
        net.place.set([g.origin[0] + (i + x / m) * h, g.origin[1] + (j + y / m) * h, g.origin[2] + (k + z / m) * h], 3 * to);
        net.normal.set([-gx / size, -gy / size, -gz / size], 3 * to);
        net.spare[to] = out / m;
      }
}

/** Triangles between the vertices of the four cells around each edge that crosses zero. */
function joinVertices({ nx, ny, nz }: Grid, values: Float32Array, number: Int32Array, net: Net): void {
  const slab = ny * nz;
  const along = [slab, nz, 1];
  let t = 0;
  for (let i = 1; i + 1 < nx; i++)
    for (let j = 1; j + 1 < ny; j++)
      for (let k = 1, n = i * slab + j * nz + 1; k + 1 < nz; k++, n++) {
        const solid = values[n]! > 0;
        for (let e = 0; e < 3; e++) {
          if (values[n + along[e]!]! > 0 === solid) continue;
          const p = along[(e + 1) % 3]!;
          const r = along[(e + 2) % 3]!;
          const [a, c] = [number[n - p - r]!, number[n]!];
          const [b, d] = solid ? [number[n - r]!, number[n - p]!] : [number[n - p]!, number[n - r]!];
          if (t + 6 > net.index.length) net.index = grown(net.index, t + 6);
          net.index[t++] = a;
          net.index[t++] = b;
          net.index[t++] = c;
          net.index[t++] = a;
          net.index[t++] = c;
          net.index[t++] = d;
        }
      }
  net.triangles = t / 3;
}

function room(old: Net, count: number): Net {
  if (old.spare.length >= count) return { ...old };
  const n = Math.ceil(1.3 * count);
  return { ...old, place: new Float32Array(3 * n), normal: new Float32Array(3 * n), spare: new Float32Array(n), index: grown(old.index, 6.6 * n) };
}

function grown(old: Uint32Array, least: number): Uint32Array {
  const out = new Uint32Array(Math.ceil(1.3 * least));
  out.set(old);
  return out;
}
