// The stock as it is drawn. It is a picture only: the proof has a finer model.
import { BufferAttribute, BufferGeometry, Color, DoubleSide, GLSL3, Matrix4, Mesh, ShaderMaterial, Sphere, Vector3 } from "three";
import type { ChunkEntry, Table } from "../shared/view-file";
import { STOCK } from "./colours";
import { noNet, surface, type Net } from "./distance-field";
import { StockStates, type CutterPath } from "./stock-states";

const VERTEX = /* glsl */ `
in float spare; out vec3 vPlace; out vec3 vEye; out vec3 vNormal_; out float vSpare;
void main() {
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  vPlace = (modelMatrix * vec4(position, 1.0)).xyz; vEye = -eye.xyz; vSpare = spare; vNormal_ = normalMatrix * normal;
  gl_Position = projectionMatrix * eye;
}`;
const FRAGMENT = /* glsl */ `
precision highp float;
in vec3 vPlace; in vec3 vEye; in vec3 vNormal_; in float vSpare; out vec4 outColour;
uniform vec4 section; uniform float least; uniform vec3 base;
void main() {
  if (dot(section.xyz, vPlace) > section.w) discard;
  if (vSpare < least) discard; // the part is seen here
  if (!gl_FrontFacing) {
    outColour = vec4(mix(base, base * 0.86, step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / 9.0))) * 0.86, 1.0);
    return;
  }
  vec3 n = normalize(vNormal_), eye = normalize(vEye);
  float shade = 0.56 + 0.34 * max(dot(n, normalize(vec3(-0.35, 0.55, 0.75))), 0.0) + 0.16 * max(dot(n, eye), 0.0);
  outColour = vec4(base * shade, 1.0);
}`;
const SHOWN = 0.08; // of a step: where the stock stands out of the part by less, the part is drawn

export class Stock {
  readonly mesh: Mesh;
  /** mm that stock stands out of the part where it is drawn. */
  readonly least: number;
  private readonly states: StockStates;
  private net: Net = noNet();
  private hasPaths = false;

  /** `allowed`: where the stock stands out of the part by less, mm, the part is drawn. */
  constructor(entry: ChunkEntry, t: Table, section: { value: unknown }, allowed: number) {
    this.states = new StockStates(entry, t);
    this.least = Math.max(SHOWN * entry.step_mm!, allowed);
    const material = new ShaderMaterial({ glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, side: DoubleSide,
      polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2, uniforms: { section, least: { value: this.least }, base: { value: new Color(...STOCK) } } });
    this.mesh = new Mesh(new BufferGeometry(), material);
    this.mesh.visible = false;
    const { nx, ny, nz, step, origin } = this.states.grid; // for rays: encloses the surface at every second
    const half = new Vector3(nx, ny, nz).multiplyScalar(0.5 * step);
    this.mesh.geometry.boundingSphere = new Sphere(new Vector3(...origin).add(half), half.length());
    this.mesh.frustumCulled = false;
    const r = entry.rotation!;
    // rows of the rotation are the axes of the grid in the setup frame
    this.mesh.applyMatrix4(new Matrix4().set(r[0]!, r[3]!, r[6]!, 0, r[1]!, r[4]!, r[7]!, 0, r[2]!, r[5]!, r[8]!, 0, 0, 0, 0, 1));
  }

  /** Shows the stock at a second, cut along the paths; null hides it. */
  showAt(seconds: number | null, paths: { readonly cutterPaths: CutterPath[] }): void {
    this.mesh.visible = seconds !== null;
    if (seconds === null) return;
    if (!this.hasPaths) this.states.follow(paths.cutterPaths);
    this.hasPaths = true;
    this.states.time(seconds);
    this.drawSurface();
  }

  /** The paths have changed. */
  forgetPaths(): void {
    this.hasPaths = false;
  }

  private drawSurface(): void {
    const s = this.states;
    const before = this.net;
    this.net = surface(s.grid, s.values, s.part, before);
    const g = this.mesh.geometry;
    if (this.net.place !== before.place || this.net.index !== before.index) {
      g.dispose();
      g.setAttribute("position", new BufferAttribute(this.net.place, 3));
      g.setAttribute("normal", new BufferAttribute(this.net.normal, 3));
      g.setAttribute("spare", new BufferAttribute(this.net.spare, 1));
      g.setIndex(new BufferAttribute(this.net.index, 1));
    } else {
      for (const name of ["position", "normal", "spare"]) g.attributes[name]!.needsUpdate = true;
      g.index!.needsUpdate = true;
    }
    g.setDrawRange(0, 3 * this.net.triangles);
  }
}
