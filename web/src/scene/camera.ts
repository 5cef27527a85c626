// The camera: where it stands, what it looks at, and the moves that pointer, keys and buttons make.
import { PerspectiveCamera, Raycaster, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Bounds, P3 } from "./coordinates";

export const OVERVIEW: P3 = [-0.55, -0.95, 0.9];
const RADIANS = Math.PI / 180;
const ELEVATIONS = [35, 60, 15, 85, -20]; // degrees, in the order in which a free line of sight is searched
const AZIMUTHS = 12;

/** Directions from which a place may be seen, the present one first. */
function viewDirections(present: Vector3): Vector3[] {
  const directions = [present];
  for (const elevation of ELEVATIONS)
    for (let k = 0; k < AZIMUTHS; k++) {
      const a = (2 * Math.PI * k) / AZIMUTHS + 0.3;
      const e = elevation * RADIANS;
      directions.push(new Vector3(Math.cos(a) * Math.cos(e), Math.sin(a) * Math.cos(e), Math.sin(e)));
    }
  return directions;
}

export class Camera {
  readonly perspective = new PerspectiveCamera(32, 1, 0.1, 10000);
  private controls: OrbitControls | null = null;
  private covered = 0; // pixels at the lower edge of the canvas that the legend covers
  private bounds: Bounds | null = null;

  /** `onChange` asks for a frame. */
  constructor(private readonly onChange: () => void) {
    this.perspective.up.set(0, 0, 1);
  }

  /** Lets pointer and touch on the canvas move the camera; `onStart` and `onEnd` frame each drag. */
  attach(canvas: HTMLCanvasElement, onStart: () => void, onEnd: () => void): void {
    const controls = new OrbitControls(this.perspective, canvas);
    controls.enableDamping = false;
    controls.zoomToCursor = true;
    controls.addEventListener("change", () => this.onChange());
    controls.addEventListener("start", onStart);
    controls.addEventListener("end", onEnd);
    this.controls = controls;
  }

  private get orbit(): OrbitControls {
    return this.controls!;
  }

  private get canvas(): HTMLCanvasElement {
    return this.orbit.domElement as HTMLCanvasElement;
  }

  begin(bounds: Bounds): void {
    this.bounds = bounds;
    this.fit();
  }

  resize(width: number, height: number): void {
    this.perspective.aspect = width / height;
    this.setCovered(this.covered);
  }

  /** Moves the centre of the view to the middle of what the legend leaves free. */
  setCovered(pixels: number): void {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    this.covered = pixels;
    if (w && h) this.perspective.setViewOffset(w, h, 0, 0.5 * pixels, w, h);
    this.onChange();
  }

  /** Shows the whole part along a direction. */
  fit(direction: P3 = OVERVIEW): void {
    const { middle, size } = this.bounds!;
    const d = new Vector3(...direction).normalize();
    this.orbit.target.copy(middle);
    this.perspective.position.copy(middle).addScaledVector(d, this.distanceOfAll(d));
    this.perspective.near = size / 500;
    this.perspective.far = size * 60;
    this.perspective.updateProjectionMatrix();
    this.orbit.update();
    this.onChange();
  }

  /** Looks at a place so that a sphere of `radius` (mm) around it fills the view; `isFree` tells whether a ray meets no part. */
  lookAt(point: P3, radius: number, isFree: (ray: Raycaster) => boolean): void {
    const p = new Vector3(...point);
    const present = this.perspective.position.clone().sub(this.orbit.target).normalize();
    const far = this.distanceOf(radius);
    const free = viewDirections(present).find((d) => isFree(new Raycaster(p.clone().addScaledVector(d, 0.02 * radius + 0.05), d, 0, far)));
    this.orbit.target.copy(p);
    this.perspective.position.copy(p).addScaledVector(free ?? present, far);
    this.orbit.update();
    this.onChange();
  }

  /** Turns and tilts the camera (rad), moves it (shares of its distance) and changes its distance (a factor). */
  nudge(turn: number, tilt: number, x: number, y: number, factor: number): void {
    const t = this.orbit.target;
    const off = this.perspective.position.clone().sub(t);
    const r = off.length() * factor;
    let polar = Math.acos(Math.min(1, Math.max(-1, off.z / off.length())));
    const azimuth = Math.atan2(off.y, off.x) + turn;
    polar = Math.min(Math.PI - 0.01, Math.max(0.01, polar + tilt));
    const right = new Vector3().setFromMatrixColumn(this.perspective.matrix, 0).multiplyScalar(x * r);
    const up = new Vector3().setFromMatrixColumn(this.perspective.matrix, 1).multiplyScalar(y * r);
    t.add(right).add(up);
    this.perspective.position.set(Math.sin(polar) * Math.cos(azimuth), Math.sin(polar) * Math.sin(azimuth), Math.cos(polar))
      .multiplyScalar(r).add(t);
    this.orbit.update();
  }

  /** Position and target, mm, rounded to 0.01. */
  get pose(): number[] {
    return [...this.perspective.position.toArray(), ...this.orbit.target.toArray()].map((v) => Math.round(v * 100) / 100);
  }

  /** Ignores a pose from which nothing can be seen. */
  set pose(p: number[]) {
    const off = new Vector3(p[0]! - p[3]!, p[1]! - p[4]!, p[2]! - p[5]!).length();
    if (!(off > this.perspective.near && off < this.perspective.far)) return;
    this.perspective.position.set(p[0]!, p[1]!, p[2]);
    this.orbit.target.set(p[3]!, p[4]!, p[5]);
    this.orbit.update();
    this.onChange();
  }

  /** Where a place is drawn, CSS pixels of the canvas; null if it is behind the camera. */
  screen(p: Vector3): { x: number; y: number } | null {
    const q = p.clone().project(this.perspective);
    if (q.z > 1) return null;
    return { x: ((q.x + 1) / 2) * this.canvas.clientWidth, y: ((1 - q.y) / 2) * this.canvas.clientHeight };
  }

  /** Distance from which a sphere of `radius` fills the view. */
  private distanceOf(radius: number): number {
    const half = (this.perspective.fov * Math.PI) / 360;
    return radius / Math.sin(Math.min(half, Math.atan(Math.tan(half) * this.perspective.aspect)));
  }

  /** Distance from which all corners of the bounding box are seen along a direction. */
  private distanceOfAll(d: Vector3): number {
    const { low, high, middle, size } = this.bounds!;
    const right = new Vector3().crossVectors(this.perspective.up, d).normalize();
    const up = new Vector3().crossVectors(d, right);
    const half = 0.88 * Math.tan((this.perspective.fov * Math.PI) / 360);
    const tall = half * Math.max(0.4, 1 - this.covered / (this.canvas.clientHeight || Infinity));
    let far = 0.5 * size;
    for (let c = 0; c < 8; c++) {
      const o = new Vector3(...([0, 1, 2].map((k) => (c & (1 << k) ? high[k]! : low[k]!)) as P3)).sub(middle);
      far = Math.max(far, o.dot(d) + Math.max(Math.abs(o.dot(right)) / (half * this.perspective.aspect), Math.abs(o.dot(up)) / tall));
    }
    return far;
  }
}
