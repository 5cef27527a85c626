// What a ray meets: the place under the pointer, and whether a place can be seen.
import { Raycaster, Vector2, Vector3, type BufferAttribute, type Intersection, type Mesh } from "three";
import type { Camera } from "./camera";
import type { Part } from "./part";
import type { Section } from "./section";
import type { Stock } from "./stock";

/**
 * The place under the pointer. `cut`: it lies on the plane of the section. `spare`: it lies on the stock, that many mm out
 * of the part, exact to one step of the grid; null on the part. `face`, `label`, `left`, `judged`: of the nearest corner.
 */
export interface Hit {
  point: Vector3;
  cut: boolean;
  spare: number | null;
  face: number;
  label: number;
  left: number;
  judged: number;
}

const NO_FACE = { face: -1, label: -1, left: 0, judged: 0 };

export class Picking {
  /** `stock` returns the stock while it is shown. */
  constructor(private readonly camera: Camera, private readonly part: Part, private readonly section: Section, private readonly stock: () => Stock | null) {}

  /** The place of part or stock under a point of the page, CSS pixels. */
  pick(canvas: HTMLCanvasElement, x: number, y: number): Hit | null {
    this.camera.perspective.updateMatrixWorld(); // the camera may have moved since the last frame
    // a ray through an edge may slip between the facets, as in the middle of a symmetric part
    return this.pickAt(canvas, x, y) ?? this.pickAt(canvas, x + 0.31, y + 0.17) ?? this.pickAt(canvas, x - 0.17, y - 0.31);
  }

  /** Whether a ray meets no part that the section leaves. */
  isFree(ray: Raycaster): boolean {
    return !ray.intersectObjects(this.part.meshes, false).some((hit) => this.section.keeps(hit.point));
  }

  /** Whether no part hides a place from the camera; uses the rough level, which is many times faster. */
  isVisible(p: Vector3, size: number): boolean {
    const d = this.camera.perspective.position.clone().sub(p);
    const far = d.length();
    d.normalize();
    const ray = new Raycaster(p.clone().addScaledVector(d, 0.02 * size), d, 0, far);
    return !ray.intersectObjects(this.part.roughMeshes, false).some((hit) => this.section.keeps(hit.point));
  }

  private pickAt(canvas: HTMLCanvasElement, x: number, y: number): Hit | null {
    const box = canvas.getBoundingClientRect();
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height), this.camera.perspective);
    const kept = (hit: Intersection): boolean => this.section.keeps(hit.point);
    const onPart = ray.intersectObjects(this.part.meshes, false).filter(kept);
    const stock = this.stock();
    const onStock = stock ? ray.intersectObject(stock.mesh, false).filter(kept) : [];
    const inPart = this.startsInside(ray, onPart);
    if (inPart || this.startsInside(ray, onStock)) {
      const point = ray.ray.intersectPlane(this.section.plane, new Vector3());
      if (point) return { ...NO_FACE, point, cut: true, spare: inPart ? null : 0 };
    }
    const hit = onPart[0];
    const stockHit = onStock.find((h) => spareAt(h) >= stock!.least);
    if (stockHit && (!hit || stockHit.distance < hit.distance)) return { ...NO_FACE, point: stockHit.point, cut: false, spare: spareAt(stockHit) };
    return hit?.face ? partHit(hit) : null;
  }

  /** Whether a ray is inside a body where it passes the section: it leaves the body more often than it enters it. */
  private startsInside(ray: Raycaster, hits: Intersection[]): boolean {
    const side = (h: Intersection): number => Math.sign(h.face!.normal.clone().transformDirection(h.object.matrixWorld).dot(ray.ray.direction));
    return this.section.active && hits.reduce((sum, h) => sum + side(h), 0) > 0;
  }
}

/** mm that the stock stands out of the part where a ray meets it. */
function spareAt(hit: Intersection): number {
  const spares = (hit.object as Mesh).geometry.attributes.spare as BufferAttribute;
  const { a, b, c } = hit.face!;
  return hit.barycoord!.x * spares.getX(a) + hit.barycoord!.y * spares.getX(b) + hit.barycoord!.z * spares.getX(c);
}

/** A hit of the part, with the values of the nearest corner of its facet. */
function partHit(hit: Intersection): Hit {
  const mesh = hit.object as Mesh;
  const { position, left_: left, judged } = mesh.geometry.attributes as Record<string, BufferAttribute>;
  const distance = (corner: number): number => hit.point.distanceToSquared(new Vector3().fromBufferAttribute(position!, corner));
  const { a, b, c } = hit.face!;
  const corner = [a, b, c].reduce((best, k) => (distance(k) < distance(best) ? k : best));
  return {
    point: hit.point, cut: false, spare: null, face: (mesh.userData.face as Int32Array)[corner]!, label: mesh.userData.label as number,
    left: left!.getX(corner), judged: judged!.getX(corner),
  };
}
