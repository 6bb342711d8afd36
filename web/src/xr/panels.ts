// Panels that stay before the eye, as in the paper's figure 6: MPR, zoom around the tip, angle and distance.

import {
  CanvasTexture, GLSL3, Group, LinearMipmapLinearFilter, Mesh, PlaneGeometry, ShaderMaterial, WebGLRenderTarget, type Texture,
  type WebGLRenderer,
} from "three";
import type { Guidance } from "../api";
import type { Stage } from "../view/stage";
import type { Anchor } from "./anchor";
import { sheet } from "./sheet";

/** Distance of the panels from the eye, m; what follows is seen inside of 43 by 29 degrees (HoloLens 2). */
const DISTANCE_M = 1;
const PIXELS = 384;
/** Half of what an MPR panel shows, mm: less than on a screen, for there are fewer pixels. */
const HALF_VIEW_MM = 60;
const MPR = ["axial", "along-coronal", "along-sagittal"];

const vertexShader = `out vec2 at; void main() { at = uv; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`;
// As it is: what was drawn needs no conversion of colours.
const fragmentShader = `uniform sampler2D map; in vec2 at; out vec4 pixel; void main() { pixel = vec4(texture(map, at).rgb, 1.0); }`;

function panel(map: Texture, [x, y, width, height]: readonly [number, number, number, number]): Mesh {
  const material = new ShaderMaterial({ glslVersion: GLSL3, vertexShader, fragmentShader, uniforms: { map: { value: map } }, depthTest: false });
  const mesh = new Mesh(new PlaneGeometry(width, height), material);
  mesh.position.set(x, y, -DISTANCE_M);
  // Over the patient.
  mesh.renderOrder = 10;
  return mesh;
}

/** Panels are seen small, and lines must not fall between the pixels. */
function target(): WebGLRenderTarget {
  return new WebGLRenderTarget(PIXELS, PIXELS, { generateMipmaps: true, minFilter: LinearMipmapLinearFilter });
}

export class Panels {
  /** In the frame of the viewer. */
  readonly group = new Group();
  readonly #stage: Stage;
  readonly #canvas = document.createElement("canvas");
  readonly #texts: CanvasTexture;
  readonly #zoom = target();
  readonly #slices: { target: WebGLRenderTarget; slice: Stage["slices"][number]["slice"]; usual: number }[];
  #written = "";
  /** The picture that was drawn last. */
  #turn = -1;

  constructor(stage: Stage) {
    this.#stage = stage;
    this.group.matrixAutoUpdate = false;
    [this.#canvas.width, this.#canvas.height] = [512, 448];
    this.#texts = new CanvasTexture(this.#canvas);
    this.#slices = MPR.map((id) => {
      const { slice } = stage.slices.find(({ pane }) => pane.id === id)!;
      return { slice, target: target(), usual: slice.halfViewMm };
    });
    this.group.add(panel(this.#texts, [-0.27, 0.13, 0.24, 0.21]), panel(this.#zoom.texture, [-0.28, -0.13, 0.22, 0.22]));
    this.#slices.forEach(({ target }, i) => this.group.add(panel(target.texture, [0.31, 0.17 - 0.17 * i, 0.16, 0.16])));
    this.#slices.forEach(({ slice }) => (slice.halfViewMm = HALF_VIEW_MM));
  }

  /** What the numbers' panel says, line by line. */
  get said(): string {
    return this.#written;
  }

  /** What zoom and MPR show, in this order. */
  get pictures(): WebGLRenderTarget[] {
    return [this.#zoom, ...this.#slices.map(({ target }) => target)];
  }

  /** Writes the numbers, if they have changed. */
  write(guidance: Guidance | null, trouble: string, anchor: Anchor): void {
    const age = anchor.placedAt === null ? null : performance.now() - anchor.placedAt;
    const written = sheet(this.#canvas, { guidance, trouble }, anchor, age, this.#written);
    if (written !== this.#written) this.#texts.needsUpdate = true;
    this.#written = written;
  }

  /** Draws MPR and zoom into the panels, one picture a frame, in turn: glasses have little time, and each is still seen to move. */
  draw(renderer: WebGLRenderer): void {
    const [before, xr] = [renderer.getRenderTarget(), renderer.xr.enabled];
    renderer.xr.enabled = renderer.autoClear = false;
    this.#turn = (this.#turn + 1) % this.pictures.length;
    const sliced = this.#slices[this.#turn];
    sliced?.slice.prepare(renderer, PIXELS, PIXELS);
    renderer.setRenderTarget(sliced?.target ?? this.#zoom);
    renderer.clear();
    if (sliced) sliced.slice.draw(renderer, this.#stage.deformed);
    else this.#stage.world.drawTip(renderer, 1);
    renderer.setRenderTarget(before);
    renderer.xr.enabled = xr;
  }

  dispose(): void {
    this.#slices.forEach(({ slice, usual }) => (slice.halfViewMm = usual));
    [this.#zoom, ...this.#slices.map((s) => s.target)].forEach((t) => t.dispose());
    this.#texts.dispose();
  }
}
