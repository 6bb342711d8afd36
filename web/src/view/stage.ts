// One WebGL context for all panes: they share the CT and the surfaces, and each is drawn into its own rectangle.

import { Vector3, WebGLRenderer } from "three";
import type { Container } from "../api";
import type { Snapshot } from "../snapshot";
import { ct, WINDOWS } from "./ct";
import { Displacement } from "./displacement";
import { Slice, type SliceName } from "./slice";
import { surfaces, type SceneHeader, type SurfaceName } from "./surfaces";
import { World } from "./world";

const SLICES: SliceName[] = ["axial", "coronal", "sagittal"];
/** mm a slice moves by one click of the wheel or one key. */
const STEP_MM = 1;

function pane(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (!found) throw new Error(`The page has no #${id}.`);
  return found;
}

export class Stage {
  /** Whether the crosshair follows the tip. */
  follow = true;
  readonly #renderer: WebGLRenderer;
  readonly #displacement: Displacement;
  readonly #world: World;
  readonly #slices: { pane: HTMLElement; slice: Slice }[];
  readonly #cross: Vector3;
  #dirty = true;

  constructor(scene: Container, images: Container | null) {
    const canvas = pane("stage") as HTMLCanvasElement;
    this.#renderer = new WebGLRenderer({ canvas, antialias: true, alpha: false });
    this.#renderer.autoClear = false;
    const header = scene.header as SceneHeader;
    this.#displacement = new Displacement(header.node_count);
    const all = surfaces(scene, this.#displacement.texture);
    const loaded = images ? ct(images) : null;
    this.#world = new World(pane("scene"), header, all, () => (this.#dirty = true));
    this.#cross = new Vector3(...header.plan.target_lps_mm);
    this.#slices = SLICES.map((name) => {
      const p = pane(name);
      const slice = new Slice(p, name, header, all, loaded);
      slice.through(this.#cross);
      this.#listen(p, slice);
      return { pane: p, slice };
    });
    new ResizeObserver(() => this.#resize(canvas)).observe(canvas);
    this.#resize(canvas);
  }

  #resize(canvas: HTMLCanvasElement): void {
    this.#renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.#renderer.setSize(canvas.clientWidth, canvas.clientHeight, false);
    this.#dirty = true;
  }

  #listen(p: HTMLElement, slice: Slice): void {
    const pick = (e: PointerEvent): void => {
      const box = p.getBoundingClientRect();
      this.cross(slice.pick(e.clientX - box.left, e.clientY - box.top, box.width, box.height));
    };
    p.addEventListener("pointerdown", (e) => {
      p.setPointerCapture(e.pointerId);
      this.onFree?.();
      pick(e);
    });
    p.addEventListener("pointermove", (e) => p.hasPointerCapture(e.pointerId) && pick(e));
    p.addEventListener("wheel", (e) => {
      e.preventDefault();
      if (e.ctrlKey) this.#zoom(slice, Math.exp(e.deltaY / 300));
      else this.#move(slice, Math.sign(e.deltaY));
    }, { passive: false });
    p.addEventListener("keydown", (e) => {
      if (e.key === "PageUp" || e.key === "PageDown") this.#move(slice, e.key === "PageUp" ? -1 : 1);
      else if (e.key === "+" || e.key === "-") this.#zoom(slice, e.key === "+" ? 0.9 : 1 / 0.9);
      else return;
      e.preventDefault();
    });
  }

  /** Called when the user moves the crosshair, so that it stops following the tip. */
  onFree: (() => void) | undefined;

  #move(slice: Slice, steps: number): void {
    this.onFree?.();
    this.cross(this.#cross.clone().addScaledVector(slice.normal, steps * STEP_MM));
  }

  #zoom(slice: Slice, factor: number): void {
    slice.halfViewMm = Math.min(300, Math.max(15, slice.halfViewMm * factor));
    this.#dirty = true;
  }

  /** Puts the crosshair of all slices at a point. */
  cross(p: Vector3): void {
    this.#cross.copy(p);
    this.#slices.forEach(({ slice }) => slice.through(p));
    this.#dirty = true;
  }

  window(name: keyof typeof WINDOWS): void {
    const [centre, width] = WINDOWS[name];
    this.#slices.forEach(({ slice }) => slice.window(centre, width));
    this.#dirty = true;
  }

  setVisible(name: SurfaceName, visible: boolean): void {
    this.#world.setVisible(name, visible);
    this.#dirty = true;
  }

  setColoured(coloured: boolean): void {
    this.#world.setColoured(coloured);
    this.#dirty = true;
  }

  take(snapshot: Snapshot): void {
    if (this.#displacement.take(snapshot)) this.#slices.forEach(({ slice }) => slice.touch());
    this.#world.take(snapshot.guidance);
    this.#slices.forEach(({ slice }) => slice.take(snapshot.guidance));
    const tip = snapshot.guidance.tip_lps_mm;
    if (this.follow && tip) this.cross(new Vector3(...tip));
    this.#dirty = true;
  }

  /** Draws what has changed; returns whether anything was drawn. */
  draw(): boolean {
    if (!this.#dirty) return false;
    this.#dirty = false;
    const r = this.#renderer;
    // Outlines always belong to the slice and the tissue that are shown, however slow the machine is.
    for (const s of this.#slices) s.slice.prepare(r, ...this.#deviceSize(s.pane));
    r.setScissorTest(true);
    this.#rectangle(pane("scene"), (aspect) => this.#world.draw(r, aspect));
    this.#rectangle(pane("inset"), (aspect) => this.#world.drawInset(r, aspect));
    for (const s of this.#slices) this.#rectangle(s.pane, () => s.slice.draw(r));
    r.setScissorTest(false);
    return true;
  }

  #deviceSize(p: HTMLElement): [number, number] {
    const ratio = this.#renderer.getPixelRatio();
    return [Math.max(1, Math.round(p.clientWidth * ratio)), Math.max(1, Math.round(p.clientHeight * ratio))];
  }

  #rectangle(p: HTMLElement, draw: (aspect: number) => void): void {
    const [box, stage] = [p.getBoundingClientRect(), this.#renderer.domElement.getBoundingClientRect()];
    if (box.width < 1 || box.height < 1) return;
    const rectangle = [box.left - stage.left, stage.bottom - box.bottom, box.width, box.height] as const;
    this.#renderer.setViewport(...rectangle);
    this.#renderer.setScissor(...rectangle);
    this.#renderer.clear();
    draw(box.width / box.height);
  }
}
