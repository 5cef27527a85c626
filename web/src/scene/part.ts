// The part: its facets in two levels of detail, its edges, its colours, and the labels that stand out.
import {
  BufferAttribute, BufferGeometry, Color, DoubleSide, GLSL3, Group, LinearSRGBColorSpace, LineBasicMaterial, LineSegments, Mesh,
  MeshBasicMaterial, ShaderMaterial,
} from "three";
import type { ChunkEntry, Table, ViewHead } from "../shared/view-file";
import { CLASSES, CONNECTION, HIGHLIGHT, OTHER, PALE, REMAINDER, REMAINDER_PALE, STEPS, UNCUT, UNNAMED, wallColour, zoneColour, type RGB } from "./colours";
import { placesOf } from "./coordinates";
import type { Section } from "./section";
import { PART_FRAGMENT, PART_VERTEX } from "./shaders";

/** What the colours of the part mean. */
export type Mode = "zones" | "walls" | "deviation";

const MODES: Mode[] = ["zones", "walls", "deviation"]; // as the shader numbers them

/** The facets of one label: a zone, an entry of the remainder, or what is neither. */
interface LabelMesh {
  lod: number;
  mesh: Mesh;
}

export class Part {
  readonly group = new Group();
  /** Labels that stand out, drawn over what hides them. */
  readonly highlighted = new Group();
  private head: ViewHead | null = null;
  private readonly labels = new Map<number, LabelMesh>(); // the finest level of each
  private readonly rough = new Map<number, Mesh>();
  private readonly wallOf = new Map<number, RGB>(); // by face
  private edges: LineSegments | null = null;
  private ink = "#15202b";
  private readonly uniforms: Record<string, { value: unknown }>;

  constructor(private readonly section: Section) {
    this.uniforms = {
      mode: { value: 0 }, faded: { value: 0 }, lit: { value: 0.06 }, section: section.uniform,
      limits: { value: [0, 0, 0, 0, 0, 0] }, classes: { value: CLASSES.map((c) => new Color(...c)) },
      uncut: { value: new Color(...UNCUT) }, pale: { value: new Color(...PALE) }, stripe: { value: new Color(...REMAINDER) },
      cap: { value: section.colour }, paper: { value: new Color(1, 1, 1) },
    };
  }

  begin(head: ViewHead): void {
    this.head = head;
    head.walls.forEach((w, i) => w.faces.forEach((f) => this.wallOf.set(f, wallColour(i))));
    head.connections.forEach((c) => c.faces.forEach((f) => this.wallOf.set(f, CONNECTION)));
    const low = head.budget_mm.gouge + 1e-6;
    const high = head.budget_mm.scallop + 1e-6;
    this.uniforms.limits!.value = [-STEPS[1]! * low, -STEPS[0]! * low, -low, high, STEPS[0]! * high, STEPS[1]! * high];
  }

  addFacets(entry: ChunkEntry, t: Table): void {
    const label = entry.label!;
    const old = this.labels.get(label);
    if (old && old.lod > entry.lod) return;
    const mesh = new Mesh(this.geometryOf(t), this.materialOf(label));
    mesh.userData = { label, face: t.face };
    if (old) {
      old.mesh.material = mesh.material; // both levels look the same
      this.rough.set(label, old.mesh);
    }
    this.labels.set(label, { lod: entry.lod, mesh });
    this.group.add(mesh);
  }

  addEdges(t: Table): void {
    const begins = t.begins!;
    const index: number[] = [];
    for (let k = 0; k + 1 < begins.length; k++)
      for (let i = begins[k]!; i + 1 < begins[k + 1]!; i++) index.push(i, i + 1);
    const g = new BufferGeometry();
    g.setAttribute("position", new BufferAttribute(placesOf(t, this.head!.low_mm, this.head!.mesh_grid_mm), 3));
    g.setIndex(index);
    this.edges = new LineSegments(g, new LineBasicMaterial({ color: this.ink, transparent: true, opacity: 0.7 }));
    this.group.add(this.edges);
    this.clip();
  }

  /** Removes rough facets of labels that have none in the fine level: they would hide the fine ones. */
  settle(): void {
    const finest = Math.max(0, ...[...this.labels.values()].map((p) => p.lod));
    for (const [label, p] of this.labels)
      if (p.lod < finest && this.head!.chunks.some((c) => c.kind === "mesh" && c.lod === finest)) {
        this.group.remove(p.mesh);
        this.labels.delete(label);
      }
  }

  /** Facets of the finest level there is. */
  get meshes(): Mesh[] {
    return [...this.labels.values()].map((p) => p.mesh);
  }

  /** Facets of the rough level, where there is one. */
  get roughMeshes(): Mesh[] {
    return [...this.labels].map(([label, { mesh }]) => this.rough.get(label) ?? mesh);
  }

  showLevel(rough: boolean): void {
    for (const [label, { mesh }] of this.labels) {
      const coarse = this.rough.get(label);
      mesh.visible = !(coarse && rough);
      if (coarse) coarse.visible = rough;
    }
  }

  setMode(mode: Mode): void {
    this.uniforms.mode!.value = MODES.indexOf(mode);
  }

  /** Fades zones and walls, so that tool paths are seen on them. */
  fade(on: boolean): void {
    this.uniforms.faded!.value = on && this.uniforms.mode!.value !== MODES.indexOf("deviation") ? 0.6 : 0;
  }

  /** Makes some labels stand out, also through what hides them; null: none. */
  highlight(labels: Set<number> | null): void {
    for (const [label, { mesh }] of this.labels) {
      const m = mesh.material as ShaderMaterial;
      m.uniforms.faded = labels ? { value: labels.has(label) ? 0 : 0.82 } : (this.uniforms.faded as never);
      m.uniforms.lit = labels?.has(label) ? { value: 0.16 } : (this.uniforms.lit as never);
    }
    this.highlighted.clear();
    for (const label of labels ?? []) {
      const known = this.labels.get(label);
      if (!known) continue;
      const overlay = new Mesh(known.mesh.geometry, new MeshBasicMaterial({ color: HIGHLIGHT, transparent: true, opacity: 0.28,
        depthTest: false, depthWrite: false, side: DoubleSide, clippingPlanes: this.section.clippingPlanes }));
      overlay.renderOrder = 5;
      this.highlighted.add(overlay);
    }
  }

  /** Follows the section with what has no shader of its own. */
  clip(): void {
    const planes = this.section.clippingPlanes;
    if (this.edges) (this.edges.material as LineBasicMaterial).clippingPlanes = planes;
    for (const m of this.highlighted.children) ((m as Mesh).material as MeshBasicMaterial).clippingPlanes = planes;
  }

  theme(background: string, ink: string): void {
    (this.uniforms.paper!.value as Color).setStyle(background, LinearSRGBColorSpace).lerp(new Color(1, 1, 1), 0.35);
    if (this.edges) (this.edges.material as LineBasicMaterial).color.set(ink);
    this.ink = ink;
  }

  private geometryOf(t: Table): BufferGeometry {
    const head = this.head!;
    const n = t.face!.length;
    const g = new BufferGeometry();
    g.setAttribute("position", new BufferAttribute(placesOf(t, head.low_mm, head.mesh_grid_mm), 3));
    g.setAttribute("normal", new BufferAttribute(Int8Array.from(t.normal!), 3, true));
    const left = new Float32Array(n);
    const wall = new Uint8Array(3 * n);
    for (let i = 0; i < n; i++) {
      left[i] = t.left![i]! * head.left_unit_mm;
      const c = this.wallOf.get(t.face![i]!) ?? UNNAMED;
      for (let k = 0; k < 3; k++) wall[3 * i + k] = 255 * c[k]!;
    }
    g.setAttribute("left_", new BufferAttribute(left, 1));
    g.setAttribute("judged", new BufferAttribute(Uint8Array.from(t.judged!), 1));
    g.setAttribute("wall", new BufferAttribute(wall, 3, true));
    g.setIndex(new BufferAttribute(Uint32Array.from(t.corners!), 1));
    return g;
  }

  private materialOf(label: number): ShaderMaterial {
    const { colour, hatched } = this.colourOf(label);
    return new ShaderMaterial({
      glslVersion: GLSL3, vertexShader: PART_VERTEX, fragmentShader: PART_FRAGMENT, side: DoubleSide,
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
      uniforms: { ...this.uniforms, own: { value: new Color(...colour) }, hatched: { value: hatched ? 1 : 0 } },
    });
  }

  private colourOf(label: number): { colour: RGB; hatched: boolean } {
    const what = label < 0 ? undefined : this.head!.labelled[label];
    if (what?.zone) return { colour: zoneColour(this.head!.zones.findIndex((z) => z.id === what.zone)), hatched: false };
    if (what?.remainder !== undefined) return { colour: REMAINDER_PALE, hatched: true };
    return { colour: OTHER, hatched: false };
  }
}
