// The section: the plane that cuts part and stock away, and the cut faces in it.
import { Color, Group, Plane, Vector3, Vector4, type Mesh } from "three";
import { STOCK } from "./colours";
import { CutFace } from "./cut-face";
import type { Bounds } from "./coordinates";

const NO_SECTION = new Vector4(0, 0, 0, 1);

export class Section {
  readonly faces = new Group();
  /** For shaders: (x, y, z) is the unit normal; a place p is cut away where normal · p > w. All zero but w: no section. */
  readonly uniform = { value: NO_SECTION.clone() };
  readonly colour = new Color(0.55, 0.57, 0.6);
  /** The same plane for materials and rays of three, where what is kept lies on the positive side. */
  readonly plane = new Plane();
  private readonly partFace: CutFace;
  private readonly stockFace: CutFace;

  constructor() {
    this.partFace = new CutFace(this.uniform, this.colour, -2);
    this.stockFace = new CutFace(this.uniform, new Color(...STOCK), -4);
    this.faces.add(this.partFace.group, this.stockFace.group);
  }

  /** Puts the plane across an axis, at a share of the bounding box; null: no section. */
  set(axis: 0 | 1 | 2 | null, share: number, flipped: boolean, bounds: Bounds): void {
    const s = this.uniform.value;
    if (axis === null) s.copy(NO_SECTION);
    else {
      const at = bounds.low[axis] + share * (bounds.high[axis] - bounds.low[axis]);
      const n = new Vector3().setComponent(axis, flipped ? -1 : 1);
      s.set(n.x, n.y, n.z, flipped ? -at : at);
    }
    this.plane.set(new Vector3(-s.x, -s.y, -s.z), s.w);
  }

  get active(): boolean {
    const s = this.uniform.value;
    return s.x !== 0 || s.y !== 0 || s.z !== 0;
  }

  /** Planes that clip built-in materials. */
  get clippingPlanes(): Plane[] {
    return this.active ? [this.plane] : [];
  }

  /** Whether the section leaves a place. */
  keeps(p: Vector3): boolean {
    const s = this.uniform.value;
    return s.x * p.x + s.y * p.y + s.z * p.z <= s.w;
  }

  /** Makes the cut faces of these bodies. */
  fill(part: Mesh[], stock: Mesh[], bounds: Bounds): void {
    if (!this.active) return;
    this.partFace.cut(this.uniform.value, part, bounds.middle, bounds.size);
    this.stockFace.cut(this.uniform.value, stock, bounds.middle, bounds.size);
  }

  /** Shows the cut faces; without them the inside of the bodies is seen. */
  show(part: boolean, stock: boolean): void {
    this.partFace.group.visible = this.active && part;
    this.stockFace.group.visible = this.partFace.group.visible && stock;
  }
}
