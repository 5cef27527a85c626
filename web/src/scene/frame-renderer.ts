// Draws frames on request. On a slow machine, frames drawn during motion have fewer pixels and the rough level of detail.
import { WebGLRenderer, type PerspectiveCamera, type Scene } from "three";

const SLOW_FRAME_MS = 70;
const PAUSE_MS = 2000; // a longer gap means that nothing moved
const LOWEST_RESOLUTION = 0.4;
const REST_MS = 150; // from the end of the motion to the fine frame

/** Whether the browser draws without a graphics card: smooth edges are slow then. */
function drawsInSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(gl!.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

export class FrameRenderer {
  readonly canvas: HTMLCanvasElement;
  /** Share of the pixels of the screen along each side; below 1 while something moves on a slow machine. */
  resolution = 1;
  private readonly renderer: WebGLRenderer;
  private requested = false;
  private drawnAt = 0;
  private moving = false;
  private restTimer = 0;

  /** `afterFrame` runs after each requested frame, `onResolution` when `resolution` has changed. */
  constructor(private readonly scene: Scene, private readonly camera: PerspectiveCamera, private readonly afterFrame: () => void,
    private readonly onResolution: () => void) {
    this.renderer = new WebGLRenderer({ stencil: true, antialias: !drawsInSoftware(), powerPreference: "high-performance" });
    this.renderer.localClippingEnabled = true;
    this.canvas = this.renderer.domElement;
    // a phone takes the graphics card away from a page in the background and gives it back
    this.canvas.addEventListener("webglcontextrestored", () => this.request());
  }

  resize(width: number, height: number): void {
    this.setPixelRatio();
    this.renderer.setSize(width, height, false);
  }

  /** Draws a frame before the browser shows the next one. */
  request(): void {
    if (this.requested) return;
    this.requested = true;
    requestAnimationFrame(() => {
      this.requested = false;
      const gap = performance.now() - this.drawnAt;
      this.drawnAt = performance.now();
      if (this.moving && gap > SLOW_FRAME_MS && gap < PAUSE_MS) this.setResolution(Math.max(LOWEST_RESOLUTION, this.resolution * 0.75));
      this.draw();
      this.afterFrame();
    });
  }

  startMotion(): void {
    this.moving = true;
  }

  /** Ends the motion; a fine frame follows soon. */
  endMotion(): void {
    this.moving = false;
    clearTimeout(this.restTimer);
    this.restTimer = window.setTimeout(() => this.setResolution(1), REST_MS);
  }

  /** Draws a frame now and waits for it; returns ms. */
  timed(): number {
    const from = performance.now();
    this.draw();
    const gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    return performance.now() - from;
  }

  /** The same for a frame as drawn during motion. */
  timedMoving(): number {
    const kept = this.resolution;
    this.setResolution(0.5);
    const took = Math.min(this.timed(), this.timed());
    this.setResolution(kept);
    this.timed();
    return took;
  }

  png(): string {
    this.draw();
    return this.canvas.toDataURL("image/png");
  }

  private draw(): void {
    this.renderer.render(this.scene, this.camera);
  }

  private setPixelRatio(): void {
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2) * this.resolution);
  }

  private setResolution(share: number): void {
    if (share === this.resolution) return;
    this.resolution = share;
    this.onResolution();
    this.setPixelRatio();
    this.request();
  }
}
