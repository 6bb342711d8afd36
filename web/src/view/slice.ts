// One slice of the MPR: the CT, and the deformed surfaces cut by the plane.

import {
  GLSL3, Mesh, OrthographicCamera, PlaneGeometry, Scene, ShaderMaterial, Vector2, Vector3, WebGLRenderTarget,
  type WebGLRenderer,
} from "three";
import type { Guidance } from "../api";
import type { Ct } from "./ct";
import { sliceFragment, sliceVertex } from "./shaders";
import { maskMaterial, type SceneHeader, type Surface } from "./surfaces";

export type SliceName = "axial" | "coronal" | "sagittal";

/** Screen right and up in the patient (LPS), and what stands at the four sides: radiological convention. */
const PLANES: Record<SliceName, { right: Vector3; up: Vector3; marks: [string, string, string, string] }> = {
  axial: { right: new Vector3(1, 0, 0), up: new Vector3(0, -1, 0), marks: ["R", "L", "A", "P"] },
  coronal: { right: new Vector3(1, 0, 0), up: new Vector3(0, 0, 1), marks: ["R", "L", "S", "I"] },
  sagittal: { right: new Vector3(0, 1, 0), up: new Vector3(0, 0, 1), marks: ["A", "P", "S", "I"] },
};

const SIDES = ["left", "right", "top", "bottom"] as const;
/** How much of the patient is seen at the start, from the middle to the nearer edge, mm. */
const HALF_VIEW_MM = 115;
const CUT = ["brain", "ventricles"] as const;

export class Slice {
  readonly right: Vector3;
  readonly up: Vector3;
  readonly normal: Vector3;
  /** Middle of the view, patient mm. */
  readonly centre: Vector3;
  halfViewMm = HALF_VIEW_MM;
  #dirty = true;
  readonly #material: ShaderMaterial;
  readonly #quad = new Scene();
  readonly #flat = new OrthographicCamera();
  readonly #eye = new OrthographicCamera();
  readonly #cuts: { scene: Scene; target: WebGLRenderTarget }[];
  readonly #label: HTMLOutputElement;

  constructor(pane: HTMLElement, name: SliceName, header: SceneHeader, surfaces: Surface[], ct: Ct | null) {
    const plane = PLANES[name];
    [this.right, this.up] = [plane.right, plane.up];
    this.normal = plane.right.clone().cross(plane.up);
    const brain = surfaces.find((s) => s.name === "brain") ?? surfaces[0];
    brain?.mesh.geometry.computeBoundingBox();
    this.centre = brain?.mesh.geometry.boundingBox?.getCenter(new Vector3()) ?? new Vector3();
    this.#cuts = CUT.map((n) => cut(surfaces.find((s) => s.name === n)));
    this.#material = material(header, ct, this.right, this.up, this.#cuts.map((c) => c.target));
    this.#quad.add(new Mesh(new PlaneGeometry(2, 2), this.#material));
    this.#label = marks(pane, name, plane.marks);
  }

  #set(name: string, value: unknown): void {
    const uniform = this.#material.uniforms[name];
    if (uniform) uniform.value = value;
  }

  /** The tissue has moved: cut it anew. */
  touch(): void {
    this.#dirty = true;
  }

  window(centre: number, width: number): void {
    this.#set("window", new Vector2(centre, width));
  }

  /** Puts the plane through a point. */
  through(p: Vector3): void {
    const before = this.centre.dot(this.normal);
    this.centre.addScaledVector(this.normal, p.dot(this.normal) - before);
    this.#set("crosshair", p.clone());
    this.#dirty ||= Math.abs(this.centre.dot(this.normal) - before) > 1e-3;
    const axis = this.normal.x ? "L" : this.normal.y ? "P" : "S";
    const position = p.dot(this.normal) * Math.sign(this.normal.x + this.normal.y + this.normal.z);
    this.#label.value = `${axis} ${position.toFixed(1)} mm`;
  }

  take(guidance: Guidance): void {
    const { tip_lps_mm: tip, axis_lps: axis } = guidance;
    this.#set("hasNeedle", tip !== null && axis !== null);
    if (tip) this.#set("tip", new Vector3(...tip));
    if (axis) this.#set("axis", new Vector3(...axis));
  }

  /** The patient point under a place of the pane (CSS px from its upper left corner). */
  pick(x: number, y: number, width: number, height: number): Vector3 {
    const mm = (2 * this.halfViewMm) / Math.min(width, height);
    return this.centre.clone()
      .addScaledVector(this.right, (x - width / 2) * mm)
      .addScaledVector(this.up, (height / 2 - y) * mm);
  }

  /** Cuts the surfaces, if they or the plane have moved; sizes in device px. */
  prepare(renderer: WebGLRenderer, width: number, height: number): void {
    const mm = (2 * this.halfViewMm) / Math.min(width, height);
    const half = new Vector2((width * mm) / 2, (height * mm) / 2);
    this.#set("halfExtent", half);
    this.#set("mmPerPixel", mm);
    this.#set("centre", this.centre);
    const resized = this.#cuts.some((c) => c.target.width !== width || c.target.height !== height);
    if (!this.#dirty && !resized && this.#eye.top === half.y) return;
    this.#dirty = false;
    Object.assign(this.#eye, { left: -half.x, right: half.x, top: half.y, bottom: -half.y, near: 0, far: 600 });
    this.#eye.position.copy(this.centre);
    this.#eye.up.copy(this.up);
    this.#eye.lookAt(this.centre.clone().sub(this.normal));
    this.#eye.updateProjectionMatrix();
    for (const { scene, target } of this.#cuts) {
      if (resized) target.setSize(width, height);
      renderer.setRenderTarget(target);
      renderer.clear();
      renderer.render(scene, this.#eye);
    }
    renderer.setRenderTarget(null);
  }

  draw(renderer: WebGLRenderer): void {
    renderer.render(this.#quad, this.#flat);
  }
}

/** The surface to be cut, in a scene of its own that shares the geometry. */
function cut(surface: Surface | undefined): { scene: Scene; target: WebGLRenderTarget } {
  const scene = new Scene();
  if (surface) {
    const texture = surface.mesh.material.uniforms["displacement"]?.value;
    const mesh = new Mesh(surface.mesh.geometry, maskMaterial(texture));
    mesh.frustumCulled = false;
    scene.add(mesh);
  }
  return { scene, target: new WebGLRenderTarget(1, 1) };
}

function material(
  header: SceneHeader, ct: Ct | null, right: Vector3, up: Vector3, cuts: WebGLRenderTarget[],
): ShaderMaterial {
  const { entry_lps_mm, target_lps_mm } = header.plan;
  const values: Record<string, unknown> = {
    ct: ct?.texture ?? null,
    hasCt: ct !== null,
    voxelFromPatient: ct?.voxelFromPatient,
    dims: ct?.dims ?? new Vector3(1, 1, 1),
    window: new Vector2(40, 80),
    centre: new Vector3(), right, up, normal: right.clone().cross(up), crosshair: new Vector3(),
    halfExtent: new Vector2(1, 1),
    mmPerPixel: 1,
    brain: cuts[0]?.texture, ventricles: cuts[1]?.texture,
    entry: new Vector3(...entry_lps_mm), target: new Vector3(...target_lps_mm),
    tip: new Vector3(), axis: new Vector3(),
    hasNeedle: false,
  };
  const uniforms = Object.fromEntries(Object.entries(values).map(([name, value]) => [name, { value }]));
  return new ShaderMaterial({
    glslVersion: GLSL3, vertexShader: sliceVertex, fragmentShader: sliceFragment, uniforms, depthTest: false,
  });
}

function marks(pane: HTMLElement, name: SliceName, letters: [string, string, string, string]): HTMLOutputElement {
  const title = document.createElement("h2");
  title.textContent = name[0]?.toUpperCase() + name.slice(1);
  const label = document.createElement("output");
  const letterMarks = SIDES.map((side, i) => {
    const mark = document.createElement("span");
    mark.className = `mark ${side}`;
    mark.textContent = letters[i] ?? "";
    return mark;
  });
  pane.append(title, ...letterMarks, label);
  return label;
}
