// The 3D view: skin, brain, ventricles, planned path, catheter; and the inset around the tip.

import {
  CylinderGeometry, Mesh, MeshBasicMaterial, PerspectiveCamera, Quaternion, Scene, TorusGeometry, Vector3,
  type WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Guidance, Point } from "../api";
import type { SceneHeader, Surface, SurfaceName } from "./surfaces";

const CATHETER_MM = 250;
const CATHETER_RADIUS_MM = 1.5;
const PATH_RADIUS_MM = 0.7;
/** Displacement that is shown white, mm. */
const MOVED_SCALE_MM = 6;
/** Distance of the inset's eye from the tip, mm. */
const INSET_MM = 75;

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
  readonly #inset = new PerspectiveCamera(35, 1, 1, 1000);
  readonly #scene = new Scene();
  readonly #surfaces: Surface[];
  readonly #catheter = rod(CATHETER_RADIUS_MM, "#ffffff");
  readonly #controls: OrbitControls;
  #tip: Vector3;
  #axis: Vector3;

  constructor(pane: HTMLElement, header: SceneHeader, surfaces: Surface[], onChange: () => void) {
    this.#surfaces = surfaces;
    surfaces.forEach((s) => this.#scene.add(s.mesh));
    const { entry_lps_mm, target_lps_mm } = header.plan;
    const [entry, target] = [new Vector3(...entry_lps_mm), new Vector3(...target_lps_mm)];
    const path = rod(PATH_RADIUS_MM, "#00d98c");
    place(path, entry, target);
    this.#axis = target.clone().sub(entry).normalize();
    this.#tip = entry.clone();
    this.#catheter.visible = false;
    this.#scene.add(path, this.#catheter, this.#ring(entry), this.#ring(target));
    this.#controls = this.#look(pane, target, header.plan.side);
    this.#controls.addEventListener("change", onChange);
  }

  #ring(at: Vector3): Mesh {
    const ring = new Mesh(new TorusGeometry(4, 0.5, 8, 48), new MeshBasicMaterial({ color: "#00d98c" }));
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
    return controls;
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

  take(guidance: Guidance): void {
    const { tip_lps_mm: tip, axis_lps: axis } = guidance;
    this.#catheter.visible = tip !== null && axis !== null;
    if (!tip || !axis) return;
    this.#tip = new Vector3(...(tip as Point));
    this.#axis = new Vector3(...(axis as Point));
    place(this.#catheter, this.#tip, this.#tip.clone().addScaledVector(this.#axis, -CATHETER_MM));
  }

  draw(renderer: WebGLRenderer, aspect: number): void {
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    renderer.render(this.#scene, this.camera);
  }

  /** Around the tip, seen from where the main view's eye is. Skin is left out. */
  drawInset(renderer: WebGLRenderer, aspect: number): void {
    const eye = this.camera.position.clone().sub(this.#controls.target).normalize().multiplyScalar(INSET_MM);
    this.#inset.aspect = aspect;
    this.#inset.up.copy(this.camera.up);
    this.#inset.position.copy(this.#tip).add(eye);
    this.#inset.lookAt(this.#tip);
    this.#inset.updateProjectionMatrix();
    const hidden = this.#surfaces.filter((s) => !s.soft && s.mesh.visible);
    hidden.forEach((s) => (s.mesh.visible = false));
    renderer.render(this.#scene, this.#inset);
    hidden.forEach((s) => (s.mesh.visible = true));
  }
}
