// The view file, view.bin: its types, and a reader that returns each chunk as it arrives. The format is defined in
// service/viewer/view_file.py.

export interface ColumnEntry extends Array<string | number> {
  0: string;
  1: number;
  2: number;
  3: number;
  4: string;
}

export interface ChunkEntry {
  kind: "mesh" | "edges" | "path" | "field";
  lod: number;
  label?: number;
  step?: number;
  at: number;
  size: number;
  columns: ColumnEntry[];
  rotation?: number[];
  origin_mm?: [number, number, number];
  step_mm?: number;
  shape?: [number, number, number];
  levels?: number;
}

export interface ToolShape {
  id: string;
  number: number;
  kind: string;
  /** Of a tapered mill that of its end. */
  diameter_mm: number;
  /** Angle between the side of a tapered mill, or the upper end of a barrel, and the axis; missing for all others. */
  taper_deg?: number;
  /** Radius of the large arc of a lens or barrel; missing for all others. */
  profile_radius_mm?: number;
  bodies: { kind: string; profile: [number, number][] }[];
}

export interface ViewStep {
  id: string;
  zone: string | null;
  operation: string;
  strategy: string;
  program: string;
  tool: number;
  start_s: number;
  end_s: number;
  axis: [number, number, number] | null;
}

export interface ViewFinding {
  kind: string;
  message: string;
  program: string;
  line: number;
  zone: string | null;
  face: string | null;
  point: [number, number, number] | null;
  depth: number;
  limit: number;
  count: number;
  time_s: number | null;
  /** Position of the tool at that second; missing in files of earlier versions. */
  step?: number | null;
  tip_mm?: [number, number, number] | null;
  axis?: [number, number, number] | null;
}

export interface ViewCaution {
  kind: string;
  message: string;
  remedy: string;
  subjects: string[];
  at_mm: [number, number, number] | null;
}

export interface ViewZone {
  id: string;
  tool: string;
  strategy: string;
  form: string;
  profile: string | null;
  area_mm2: number;
  faces: string[];
  coverage: number | null;
  scallop_mm: { p99: number | null; max: number | null; requested: number } | null;
  machining_time_s: number | null;
}

export interface ViewRest {
  reason: string;
  area_mm2: number;
  faces: string[];
  would_need: Record<string, unknown>;
  tool_at_hand: string | null;
  why_left: string | null;
  at_mm: [number, number, number];
}

export interface Named {
  id: string;
  faces: number[];
  at_mm: [number, number, number] | null;
  walls?: string[];
}

export interface ViewAssumption {
  what: string;
  value: string | number;
  effect: string;
  remedy: string;
}

export interface ViewHead {
  version: number;
  kind: "plan" | "verify";
  state: string;
  withheld: boolean;
  labels: Record<string, string>;
  low_mm: [number, number, number];
  mesh_grid_mm: number;
  path_grid_mm: number;
  left_unit_mm: number;
  axis_unit: number;
  bounds_mm: [[number, number, number], [number, number, number]];
  budget_mm: { scallop: number; gouge: number; allowance?: number };
  labelled: { zone?: string; remainder?: number; other?: boolean }[];
  zones: ViewZone[];
  walls: Named[];
  connections: Named[];
  remainder: ViewRest[];
  tools: ToolShape[];
  steps: ViewStep[];
  programs: string[];
  seconds: number;
  findings: ViewFinding[];
  /** Findings by kind, including those that the list leaves out; missing in files of earlier versions, as are cautions and notes. */
  found?: Record<string, number>;
  cautions?: ViewCaution[];
  notes?: string[];
  /** What the proof takes for granted; missing in files of earlier versions. */
  assumed?: ViewAssumption[];
  facts: {
    coverage: number | null;
    reach_coverage: number | null;
    machining_time_s: number | null;
    gouge_max_mm: number | null;
    complete: boolean | null;
  };
  counts: { facets: number; moves: number };
  chunks: ChunkEntry[];
}

export type Table = Record<string, Int32Array>;

const NEWEST_VERSION = 2; // of a file that this page can read
const MAGIC = "ZMVIEW1\n";

const MAX_HEAD_BYTES = 1 << 28;

/** A view file that this page cannot read; the message gives the remedy. */
export class BrokenView extends Error {}

/** Unpacks data; fails beyond `most` bytes. */
async function inflate(data: Uint8Array<ArrayBuffer>, most: number): Promise<Uint8Array> {
  const reader = new Blob([data]).stream().pipeThrough(new DecompressionStream("deflate")).getReader();
  const parts: Uint8Array<ArrayBuffer>[] = [];
  let size = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    size += value.length;
    if (size > most) throw new BrokenView("The view file is damaged: it holds more data than it declares.");
    parts.push(value);
  }
  return new Uint8Array(await new Blob(parts).arrayBuffer());
}

/** Bytes of the columns of a chunk. */
function bytesOf(columns: ColumnEntry[]): number {
  return columns.reduce((sum, [, rows, k, width]) => sum + rows * k * width, 0);
}

/** The columns of a chunk; rows of k values follow each other. */
export function columnsOf(raw: Uint8Array, entries: ColumnEntry[]): Table {
  const table: Table = {};
  if (raw.length !== bytesOf(entries)) throw new BrokenView("The view file is damaged: it holds less data than it declares.");
  let at = 0;
  for (const [name, rows, k, width, form] of entries) {
    const out = new Int32Array(rows * k);
    for (let j = 0; j < k; j++) {
      let last = 0;
      for (let i = 0; i < rows; i++) {
        let v = raw[at + i]!;
        if (width > 1) v |= raw[at + rows + i]! << 8;
        if (width > 2) v |= (raw[at + 2 * rows + i]! << 16) | (raw[at + 3 * rows + i]! << 24);
        if (form !== "plain") v = (v >>> 1) ^ -(v & 1);
        if (form === "steps") v = last += v;
        out[i * k + j] = v;
      }
      at += rows * width;
    }
    table[name] = out;
  }
  return table;
}

/** Takes bytes from a stream, any number at a time. */
class Bytes {
  private held: Uint8Array<ArrayBuffer>[] = [];
  private size = 0;
  total = 0;

  constructor(private readonly reader: ReadableStreamDefaultReader<Uint8Array<ArrayBuffer>>) {}

  async take(count: number): Promise<Uint8Array<ArrayBuffer>> {
    while (this.size < count) {
      const { done, value } = await this.reader.read();
      if (done) throw new BrokenView("The view file is incomplete. Load the page again. If that does not help, the file itself is damaged.");
      this.held.push(value);
      this.size += value.length;
      this.total += value.length;
    }
    const out = new Uint8Array(count);
    let filled = 0;
    while (filled < count) {
      const first = this.held[0]!;
      const part = first.subarray(0, count - filled);
      out.set(part, filled);
      filled += part.length;
      if (part.length === first.length) this.held.shift();
      else this.held[0] = first.subarray(part.length);
    }
    this.size -= count;
    return out;
  }
}

/** Reads a view file. `onChunk` is called for each chunk in the order of the file. Returns the number of bytes read. */
export async function readView(
  body: ReadableStream<Uint8Array<ArrayBuffer>>,
  onHead: (head: ViewHead) => void,
  onChunk: (entry: ChunkEntry, table: Table) => void,
): Promise<number> {
  const bytes = new Bytes(body.getReader());
  const start = await bytes.take(12);
  if (new TextDecoder().decode(start.subarray(0, 8)) !== MAGIC)
    throw new BrokenView("The view file has an unknown format. Load the page again. If that does not help, another version of zonemill made the file.");
  const length = new DataView(start.buffer).getUint32(8, true);
  const head = JSON.parse(new TextDecoder().decode(await inflate(await bytes.take(length), MAX_HEAD_BYTES))) as ViewHead;
  if (head.version > NEWEST_VERSION) throw new BrokenView("A later version of zonemill made the view file. Open it with that version.");
  onHead(head);
  for (const entry of head.chunks) onChunk(entry, columnsOf(await inflate(await bytes.take(entry.size), bytesOf(entry.columns)), entry.columns));
  return bytes.total;
}
