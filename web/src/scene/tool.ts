// The tool in use: its bodies, turned from their profiles, at a position.
import { DoubleSide, Group, LatheGeometry, Mesh, MeshLambertMaterial, Quaternion, Vector2, Vector3, type BufferGeometry } from "three";
import type { ToolShape } from "../shared/view-file";
import type { ToolPosition } from "./paths";

const Z_AXIS = new Vector3(0, 0, 1);
const FADED = 0.4;
const LOOKS: Record<string, [colour: number, opacity: number]> = {
  "cutting part": [0xd9a62e, 1], neck: [0x9aa3ad, 1], shank: [0x7d8791, 0.85], holder: [0x6d7a87, 0.45],
};

export class Tool {
  readonly group = new Group();
  private number = -1; // of the tool that is made
  private holder = true;

  /** Shows a tool at a position; `faded`: so that the place behind it is seen. */
  show(position: ToolPosition, number: number, shape: ToolShape | undefined, faded: boolean): void {
    this.group.visible = true;
    if (number !== this.number) this.make(number, shape);
    this.fade(faded);
    this.group.position.copy(position.place);
    this.group.quaternion.copy(new Quaternion().setFromUnitVectors(Z_AXIS, position.axis));
  }

  hide(): void {
    this.group.visible = false;
  }

  /** Counts from the next `show`. */
  showHolder(on: boolean): void {
    this.holder = on;
    this.number = -1;
  }

  private make(number: number, shape: ToolShape | undefined): void {
    this.number = number;
    this.group.clear();
    for (const body of shape?.bodies ?? []) {
      if (body.kind === "holder" && !this.holder) continue;
      const p = body.profile.map(([r, z]) => new Vector2(r, z));
      const closed = [new Vector2(0, p[0]!.y), ...p, new Vector2(0, p[p.length - 1]!.y)];
      const g = new LatheGeometry(closed, 40);
      g.rotateX(Math.PI / 2); // LatheGeometry turns around Y
      const [color, opacity] = LOOKS[body.kind] ?? [0x888888, 1];
      this.group.add(new Mesh(g, new MeshLambertMaterial({ color, transparent: opacity < 1, opacity, side: DoubleSide, depthWrite: opacity === 1, userData: { opacity } })));
    }
  }

  private fade(on: boolean): void {
    for (const { material } of this.group.children as Mesh<BufferGeometry, MeshLambertMaterial>[]) {
      const opacity = on ? Math.min(FADED, material.userData.opacity as number) : (material.userData.opacity as number);
      if (material.opacity === opacity) continue;
      material.opacity = opacity;
      material.transparent = opacity < 1;
      material.depthWrite = opacity === 1;
      material.needsUpdate = true;
    }
  }
}
