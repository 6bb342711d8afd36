// One slice of the MPR: the CT, deformed with the tissue, and the deformed surfaces cut by the plane.

import {
  BufferGeometry, CustomBlending, DoubleSide, DynamicDrawUsage, GLSL3, InterleavedBuffer, InterleavedBufferAttribute, Mesh, NoBlending,
  OneFactor, OneMinusSrcAlphaFactor, OrthographicCamera, PlaneGeometry, Scene, ShaderMaterial, Vector2, Vector3,
  WebGLRenderTarget, type IUniform, type WebGLRenderer,
} from "three";
import type { Seen } from "../api";
import type { Ct } from "./ct";
import { TetCut } from "./cut";
import type { Displacement } from "./displacement";
import { Plane, type Facing } from "./plane";
import { ctFragment, goneFragment, marksFragment, marksVertex, stillVertex, tissueVertex } from "./shaders";
import { maskMaterial, type SceneHeader, type Surface } from "./surfaces";

/** How much of the patient is seen at the start, from the middle to the nearer edge, mm. */
const HALF_VIEW_MM = 115;
const [NEAREST_MM, FARTHEST_MM] = [15, 300];
const CUT = ["brain", "ventricles"] as const;

/** What all slices share. */
export interface Tissue {
  header: SceneHeader;
  surfaces: Surface[];
  ct: Ct;
  displacement: Displacement;
  tets: Uint32Array;
}

export class Slice {
  readonly plane: Plane;
  readonly crosshair = new Vector3();
  halfViewMm = HALF_VIEW_MM;
  #dirty = true;
  readonly #shared: Tissue;
  readonly #uniforms: Record<string, IUniform>;
  readonly #still = new Scene();
  readonly #marks = new Scene();
  readonly #flat = new OrthographicCamera();
  readonly #eye = new OrthographicCamera();
  /** The tissue where it is, and before that where it was. */
  readonly #cut: CutScene;
  readonly #gone: CutScene;
  /** The plane in which the tissue at rest was cut. */
  readonly #goneAt = { normal: new Vector3(), right: new Vector3(), offset: NaN };
  readonly #outlines: { scene: Scene; target: WebGLRenderTarget }[];

  constructor(facing: Facing, tissue: Tissue) {
    const brain = tissue.surfaces.find((s) => s.name === "brain") ?? tissue.surfaces[0];
    brain?.mesh.geometry.computeBoundingBox();
    this.plane = new Plane(facing, brain?.mesh.geometry.boundingBox?.getCenter(new Vector3()) ?? new Vector3());
    this.#shared = tissue;
    this.#outlines = CUT.map((n) => outlined(tissue.surfaces.find((s) => s.name === n)));
    this.#uniforms = uniforms(tissue, this.plane, this.crosshair, this.#outlines.map((o) => o.target));
    const quad = new PlaneGeometry(2, 2);
    this.#still.add(new Mesh(quad, this.#material(stillVertex, ctFragment)));
    this.#marks.add(new Mesh(quad, this.#material(marksVertex, marksFragment, true)));
    this.#cut = new CutScene(tissue, this.#material(tissueVertex, ctFragment));
    this.#gone = new CutScene(tissue, this.#material(tissueVertex, goneFragment));
  }

  #material(vertexShader: string, fragmentShader: string, blended = false): ShaderMaterial {
    const blending = blended
      ? { blending: CustomBlending, blendSrc: OneFactor, blendDst: OneMinusSrcAlphaFactor, transparent: true }
      : ({ blending: NoBlending } as const);
    // Elements are seen from either side, and later ones lie where no earlier one is.
    return new ShaderMaterial({
      glslVersion: GLSL3, vertexShader, fragmentShader, uniforms: this.#uniforms, depthTest: false, depthWrite: false,
      side: DoubleSide, ...blending,
    });
  }

  #set(name: string, value: unknown): void {
    const uniform = this.#uniforms[name];
    if (uniform) uniform.value = value;
  }

  /** The tissue or the plane has moved: cut it anew. */
  touch(): void {
    this.#dirty = true;
  }

  /** Puts the crosshair at a point, and the plane through it unless it is held by the catheter. */
  cross(p: Vector3, through: boolean): void {
    const before = this.plane.offset;
    if (through) this.plane.through(p);
    this.crosshair.copy(p);
    this.#dirty ||= Math.abs(this.plane.offset - before) > 1e-3;
  }

  take(guidance: Seen): void {
    const { tip_lps_mm: tip, axis_lps: axis } = guidance;
    this.#set("hasNeedle", tip !== null && axis !== null);
    if (tip) this.#set("tip", new Vector3(...tip));
    if (axis) this.#set("axis", new Vector3(...axis));
  }

  setOutlines(shown: boolean): void {
    this.#set("hasOutlines", shown);
  }

  /** Enlarges what is shown by 1 / factor, around a point that stays where it is. */
  zoom(factor: number, around: Vector3): void {
    const before = this.halfViewMm;
    this.halfViewMm = Math.min(FARTHEST_MM, Math.max(NEAREST_MM, before * factor));
    const offset = this.plane.offset;
    this.plane.centre.sub(around).multiplyScalar(this.halfViewMm / before).add(around);
    this.plane.centre.addScaledVector(this.plane.normal, offset - this.plane.offset);
  }

  /** Size of a pixel of a pane of this size, mm. */
  mmPerPixel(width: number, height: number): number {
    return (2 * this.halfViewMm) / Math.min(width, height);
  }

  /** The patient point under a place of the pane (CSS px from its upper left corner). */
  pick(x: number, y: number, width: number, height: number): Vector3 {
    const mm = this.mmPerPixel(width, height);
    return this.plane.at((x - width / 2) * mm, (height / 2 - y) * mm);
  }

  /** Cuts tissue and surfaces, if they or the plane have moved; sizes in device px. */
  prepare(renderer: WebGLRenderer, width: number, height: number): void {
    const mm = this.mmPerPixel(width, height);
    const half = new Vector2((width * mm) / 2, (height * mm) / 2);
    this.#set("halfExtent", half);
    this.#set("mmPerPixel", mm);
    const resized = this.#outlines.some((o) => o.target.width !== width || o.target.height !== height);
    const moved = !this.#eye.position.equals(this.plane.centre) || this.#eye.top !== half.y;
    if (!this.#dirty && !resized && !moved) return;
    if (this.#dirty) this.#cutTissue();
    this.#dirty = false;
    this.#cutSurfaces(renderer, half, resized ? [width, height] : null);
  }

  #cutTissue(): void {
    const { ct, displacement } = this.#shared;
    if (!ct.hasCt.value) return;
    this.#cut.cut(displacement.nodes, this.plane);
    const { normal, right, offset } = this.plane;
    const at = this.#goneAt;
    if (at.offset === offset && at.normal.equals(normal) && at.right.equals(right)) return;
    this.#gone.cut(displacement.rest, this.plane);
    at.normal.copy(normal);
    at.right.copy(right);
    at.offset = offset;
  }

  #cutSurfaces(renderer: WebGLRenderer, half: Vector2, size: [number, number] | null): void {
    const { centre, up, normal } = this.plane;
    Object.assign(this.#eye, { left: -half.x, right: half.x, top: half.y, bottom: -half.y, near: 0, far: 600 });
    this.#eye.position.copy(centre);
    this.#eye.up.copy(up);
    this.#eye.lookAt(centre.clone().sub(normal));
    this.#eye.updateProjectionMatrix();
    const before = renderer.getRenderTarget();
    for (const { scene, target } of this.#outlines) {
      if (size) target.setSize(...size);
      renderer.setRenderTarget(target);
      renderer.clear();
      renderer.render(scene, this.#eye);
    }
    renderer.setRenderTarget(before);
  }

  draw(renderer: WebGLRenderer, deformed: boolean): void {
    renderer.render(this.#still, this.#flat);
    if (deformed) {
      renderer.render(this.#gone.scene, this.#flat);
      renderer.render(this.#cut.scene, this.#flat);
    }
    renderer.render(this.#marks, this.#flat);
  }
}

/** Elements cut by the plane, as a scene. */
class CutScene {
  readonly scene = new Scene();
  readonly #cut: TetCut;
  readonly #geometry = new BufferGeometry();

  constructor({ displacement, tets }: Tissue, material: ShaderMaterial) {
    this.#cut = new TetCut(displacement.rest, tets);
    const mesh = new Mesh(this.#geometry, material);
    mesh.frustumCulled = false;
    this.scene.add(mesh);
  }

  cut(nodes: Float32Array, plane: Plane): void {
    this.#cut.cut(nodes, plane);
    const { data, count } = this.#cut;
    let buffer = (this.#geometry.attributes["position"] as InterleavedBufferAttribute | undefined)?.data;
    if (buffer?.array !== data) {
      buffer = new InterleavedBuffer(data, 5).setUsage(DynamicDrawUsage);
      this.#geometry.dispose();
      this.#geometry.setAttribute("position", new InterleavedBufferAttribute(buffer, 2, 0));
      this.#geometry.setAttribute("rest", new InterleavedBufferAttribute(buffer, 3, 2));
    }
    buffer.clearUpdateRanges();
    buffer.addUpdateRange(0, 5 * count);
    buffer.needsUpdate = true;
    this.#geometry.setDrawRange(0, count);
  }
}

/** The surface to be outlined, in a scene of its own that shares the geometry. */
function outlined(surface: Surface | undefined): { scene: Scene; target: WebGLRenderTarget } {
  const scene = new Scene();
  if (surface) {
    const texture = surface.mesh.material.uniforms["displacement"]?.value;
    const mesh = new Mesh(surface.mesh.geometry, maskMaterial(surface.motion, texture));
    mesh.frustumCulled = false;
    scene.add(mesh);
  }
  return { scene, target: new WebGLRenderTarget(1, 1) };
}

function uniforms({ header, ct }: Tissue, plane: Plane, crosshair: Vector3, outlines: WebGLRenderTarget[]): Record<string, IUniform> {
  const { entry_lps_mm, target_lps_mm } = header.plan;
  const values: Record<string, unknown> = {
    centre: plane.centre, right: plane.right, up: plane.up, normal: plane.normal, crosshair,
    halfExtent: new Vector2(1, 1), mmPerPixel: 1,
    brain: outlines[0]?.texture, ventricles: outlines[1]?.texture, hasOutlines: true,
    entry: new Vector3(...entry_lps_mm), target: new Vector3(...target_lps_mm),
    tip: new Vector3(), axis: new Vector3(), hasNeedle: false,
  };
  return { ...ct, ...Object.fromEntries(Object.entries(values).map(([name, value]) => [name, { value }])) };
}
