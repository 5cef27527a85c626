// The cut faces of a section. Beyond the plane, a line of sight that is inside a body at the plane leaves bodies more often
// than it enters them. The stencil counts this, and the plane is filled where the count is not zero, before all else is drawn.
import {
  AlwaysStencilFunc, BackSide, DecrementStencilOp, DoubleSide, FrontSide, GLSL3, Group, IncrementStencilOp, Mesh, NotEqualStencilFunc, PlaneGeometry,
  ShaderMaterial, Vector3, ZeroStencilOp, type Color, type Side, type StencilOp, type Vector4,
} from "three";

const VERTEX = /* glsl */ `
out vec3 vPlace;
void main() {
  vPlace = (modelMatrix * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;
const COUNTED = /* glsl */ `
precision highp float;
in vec3 vPlace; out vec4 outColour;
uniform vec4 section;
void main() {
  if (dot(section.xyz, vPlace) > section.w) discard;
  outColour = vec4(0.0);
}`;
const FILLED = /* glsl */ `
precision highp float;
out vec4 outColour;
uniform vec3 colour;
void main() { outColour = vec4(colour * mix(1.0, 0.82, step(0.62, fract((gl_FragCoord.x + gl_FragCoord.y) / 9.0))), 1.0); }`;

export class CutFace {
  readonly group = new Group();
  private readonly counters: ShaderMaterial[];
  private readonly plane: Mesh;

  /** `order`: of drawing, below 0; in the same plane, a later face covers an earlier one. */
  constructor(section: { value: unknown }, colour: Color, private readonly order: number) {
    const counter = (side: Side, stencilZPass: StencilOp): ShaderMaterial =>
      new ShaderMaterial({ glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: COUNTED, side, uniforms: { section }, colorWrite: false, depthWrite: false,
        depthTest: false, stencilWrite: true, stencilFunc: AlwaysStencilFunc, stencilZPass });
    this.counters = [counter(BackSide, IncrementStencilOp), counter(FrontSide, DecrementStencilOp)];
    this.plane = new Mesh(new PlaneGeometry(1, 1), new ShaderMaterial({ glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FILLED, side: DoubleSide,
      uniforms: { colour: { value: colour } }, stencilWrite: true, stencilFunc: NotEqualStencilFunc, stencilRef: 0,
      stencilFail: ZeroStencilOp, stencilZFail: ZeroStencilOp, stencilZPass: ZeroStencilOp }));
    this.plane.renderOrder = order + 0.5;
    this.plane.frustumCulled = false;
  }

  /** Makes the cut face of some bodies; it spans 4 `size` mm around `middle`. */
  cut(section: Vector4, bodies: Mesh[], middle: Vector3, size: number): void {
    this.group.clear();
    const normal = new Vector3(section.x, section.y, section.z);
    this.plane.position.copy(middle).addScaledVector(normal, section.w - normal.dot(middle));
    this.plane.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), normal);
    this.plane.scale.setScalar(4 * size);
    for (const body of bodies)
      for (const [k, material] of this.counters.entries()) {
        const counted = new Mesh(body.geometry, material);
        counted.matrixAutoUpdate = false;
        counted.matrix.copy(body.matrix);
        counted.frustumCulled = false;
        counted.renderOrder = this.order + 0.2 * k; // leaving is counted first, because the count stops at 0
        this.group.add(counted);
      }
    this.group.add(this.plane);
  }
}
