// The patient: skin, brain, ventricles, planned path, target, catheter. Seen in 3D, around the tip, along the catheter,
// and through glasses.

import {
  type Camera, CylinderGeometry, Group, type Matrix4, Mesh, MeshBasicMaterial, PerspectiveCamera, Quaternion, Raycaster, Scene, SphereGeometry, TorusGeometry, Vector2, Vector3,
  type WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Seen } from "../api";
import type { SceneHeader, Surface, SurfaceName } from "./surfaces";

const CATHETER_MM = 250;
const CATHETER_RADIUS_MM = 1.5;
const PATH_RADIUS_MM = 0.7;
/** Displacement that is shown white, mm. */
export const MOVED_SCALE_MM = 6;
/** Distance of the eye from the tip in the view around it, mm. */
const TIP_MM = 75;

/** By how much a key turns the view, radians, and comes nearer. */
const [TURN, NEARER] = [Math.PI / 36, 0.9];

/** A rod from `from` to `to`; its geometry is one long along y. */
function place(rod: Mesh, from: Vector3, to: Vector3): void {
  const along = to.clone().sub(from);
  rod.position.copy(from).addScaledVector(along, 0.5);
  rod.scale.set(1, along.length(), 1);
  rod.quaternion.copy(new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), along.normalize()));
}

function rod(radius: number, colour: string): Mesh {
  return new Mesh(new CylinderGeometry(radius, radius, 1, 16), new MeshBasicMaterial({ color: colour }));
}

export class World {
  readonly camera = new PerspectiveCamera(35, 1, 10, 3000);
  /** What is drawn; glasses add to it. */
  readonly scene = new Scene();
  /** Everything in patient mm; glasses place it in the room. */
  readonly patient = new Group();
  readonly #near = new PerspectiveCamera(35, 1, 1, 1000);
  readonly #surfaces: Surface[];
  readonly #catheter = rod(CATHETER_RADIUS_MM, "#ffffff");
  readonly #target = new Mesh(new SphereGeometry(1.5, 16, 12), new MeshBasicMaterial({ color: "#f0e442" }));
  readonly #marks = new Group();
  readonly #controls: OrbitControls;
  #tip: Vector3;
  #axis: Vector3;

  constructor(pane: HTMLElement, header: SceneHeader, surfaces: Surface[], onChange: () => void) {
    this.#surfaces = surfaces;
    this.patient.matrixAutoUpdate = this.#marks.visible = false;
    this.scene.add(this.patient);
    surfaces.forEach((s) => this.patient.add(s.mesh));
    const { entry_lps_mm, target_lps_mm } = header.plan;
    const [entry, target] = [new Vector3(...entry_lps_mm), new Vector3(...target_lps_mm)];
    const path = rod(PATH_RADIUS_MM, "#00d98c");
    place(path, entry, target);
    this.#axis = target.clone().sub(entry).normalize();
    this.#tip = entry.clone();
    this.#target.position.copy(target);
    this.#catheter.visible = this.#target.visible = false;
    this.patient.add(this.#marks, path, this.#catheter, this.#target, this.#ring(entry), this.#ring(target));
    this.#controls = this.#look(pane, target, header.plan.side);
    this.#controls.addEventListener("change", onChange);
  }

  #ring(at: Vector3, color = "#00d98c"): Mesh {
    const ring = new Mesh(new TorusGeometry(4, 0.5, 8, 48), new MeshBasicMaterial({ color }));
    ring.position.copy(at);
    ring.quaternion.copy(new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), this.#axis));
    return ring;
  }

  /** From the front and the side of the entry, a little from above. */
  #look(pane: HTMLElement, target: Vector3, side: string): OrbitControls {
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(target).add(new Vector3(side === "left" ? 270 : -270, -320, 140));
    const controls = new OrbitControls(this.camera, pane);
    controls.target.copy(target);
    controls.enablePan = false;
    controls.minDistance = 60;
    controls.maxDistance = 1500;
    controls.update();
    controls.saveState();
    const keys: Record<string, () => void> = {
      ArrowLeft: () => controls.rotateLeft(TURN), ArrowRight: () => controls.rotateLeft(-TURN),
      ArrowUp: () => controls.rotateUp(TURN), ArrowDown: () => controls.rotateUp(-TURN),
      "+": () => this.#dolly(NEARER), "-": () => this.#dolly(1 / NEARER), Home: () => controls.reset(),
    };
    pane.addEventListener("keydown", (e) => {
      // Check boxes within the pane have keys of their own.
      const act = e.target === pane ? keys[e.key] : undefined;
      if (!act) return;
      act();
      e.preventDefault();
    });
    return controls;
  }

  /** Takes the eye to so many times its distance. */
  #dolly(factor: number): void {
    this.camera.position.sub(this.#controls.target).multiplyScalar(factor).add(this.#controls.target);
    this.#controls.update();
  }

  /** Places the patient in the scene: in mm as it is, unless glasses place it in the room. */
  place(sceneFromPatient: Matrix4): void {
    this.patient.matrix.copy(sceneFromPatient);
    this.patient.matrixWorldNeedsUpdate = true;
  }

  /** Shows landmarks: touched ones filled, the others as rings. */
  mark(landmarks: { at: Vector3; touched: boolean }[]): void {
    this.#marks.clear();
    for (const { at, touched } of landmarks) {
      const mark = touched ? new Mesh(new SphereGeometry(3, 16, 12), new MeshBasicMaterial({ color: "#56b4e9" })) : this.#ring(at, "#f0e442");
      mark.position.copy(at);
      this.#marks.add(mark);
    }
  }

  /** Landmarks are in the way but while they are touched. */
  showMarks(on: boolean): void {
    this.#marks.visible = on;
  }

  /** The point of the skin that is seen at a place of the view (-1 to 1, right and up). */
  skinAt(x: number, y: number): Vector3 | null {
    const skin = this.#surfaces.find((s) => s.name === "skin");
    if (!skin) return null;
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2(x, y), this.camera);
    return ray.intersectObject(skin.mesh)[0]?.point ?? null;
  }

  /** Shows or hides a surface. */
  setVisible(name: SurfaceName, visible: boolean): void {
    for (const s of this.#surfaces) if (s.name === name) s.mesh.visible = visible;
  }

  /** Shows displacement as colour. */
  setColoured(coloured: boolean): void {
    for (const s of this.#surfaces) {
      const scale = s.mesh.material.uniforms["movedScale"];
      if (scale) scale.value = coloured ? MOVED_SCALE_MM : 0;
    }
  }

  take({ tip_lps_mm: tip, axis_lps: axis, target_lps_mm: target }: Seen): void {
    this.#catheter.visible = tip !== null && axis !== null;
    this.#target.visible = target !== null;
    if (target) this.#target.position.set(...target);
    if (!tip || !axis) return;
    this.#tip = new Vector3(...tip);
    this.#axis = new Vector3(...axis);
    place(this.#catheter, this.#tip, this.#tip.clone().addScaledVector(this.#axis, -CATHETER_MM));
  }

  /** Tip and direction of the catheter, last seen, in patient mm. */
  get needle(): { tip: Vector3; axis: Vector3; seen: boolean } {
    return { tip: this.#tip, axis: this.#axis, seen: this.#catheter.visible };
  }

  /** The end of the catheter as it is drawn, in the scene. */
  drawnTip(): Vector3 {
    return this.#catheter.localToWorld(new Vector3(0, -0.5, 0));
  }

  draw(renderer: WebGLRenderer, aspect: number): void {
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    renderer.render(this.scene, this.camera);
  }

  /** Around the tip, seen from where the main view's eye is. Skin is left out. */
  drawTip(renderer: WebGLRenderer, aspect: number): void {
    const eye = this.camera.position.clone().sub(this.#controls.target).normalize().multiplyScalar(TIP_MM);
    this.#near.aspect = aspect;
    this.#near.up.copy(this.camera.up);
    this.#near.position.copy(this.#tip).add(eye);
    this.#near.lookAt(this.#tip);
    this.#near.updateProjectionMatrix();
    this.#without((s) => s.motion === "still", () => renderer.render(this.scene, this.#near));
  }

  /** Ventricles and target only. */
  drawInside(renderer: WebGLRenderer, camera: Camera): void {
    const seen = this.#catheter.visible;
    this.#catheter.visible = false;
    this.#without((s) => s.name !== "ventricles", () => renderer.render(this.scene, camera));
    this.#catheter.visible = seen;
  }

  #without(left: (s: Surface) => boolean, draw: () => void): void {
    const hidden = this.#surfaces.filter((s) => left(s) && s.mesh.visible);
    hidden.forEach((s) => (s.mesh.visible = false));
    draw();
    hidden.forEach((s) => (s.mesh.visible = true));
  }
}
