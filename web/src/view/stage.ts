// One WebGL context for all panes: they share the CT and the surfaces, and each is drawn into its own rectangle.

import { Vector3, WebGLRenderer } from "three";
import { NOTHING, type Container, type Seen } from "../api";
import { element } from "../dom";
import type { Snapshot } from "../snapshot";
import { ct } from "./ct";
import { Displacement } from "./displacement";
import { Eye } from "./eye";
import type { Facing } from "./plane";
import { Slice, type Tissue } from "./slice";
import { SlicePane } from "./slice_pane";
import { moveVertices, surfaces, type SceneHeader, type SurfaceName } from "./surfaces";
import { World } from "./world";

const SLICES: { id: string; title: string; facing: Facing; oblique: boolean }[] = [
  { id: "axial", title: "Axial", facing: "axial", oblique: false },
  { id: "coronal", title: "Coronal", facing: "coronal", oblique: false },
  { id: "sagittal", title: "Sagittal", facing: "sagittal", oblique: false },
  { id: "along-coronal", title: "Along, coronal", facing: "coronal", oblique: true },
  { id: "along-sagittal", title: "Along, sagittal", facing: "sagittal", oblique: true },
];

export class Stage {
  /** Whether the crosshair follows the tip. */
  follow = true;
  /** Called when the user moves the crosshair, so that it stops following the tip. */
  onFree: (() => void) | undefined;
  readonly renderer: WebGLRenderer;
  readonly tissue: Tissue;
  readonly world: World;
  readonly slices: SlicePane[];
  /** Whether the server moves the surfaces' vertices: this display asked for it, or its GPU cannot. Then nothing tells how
   *  the tissue moves between the surfaces, and the CT is shown as scanned. */
  readonly whole: boolean;
  readonly #eye: Eye;
  readonly #cross: Vector3;
  readonly #axis: Vector3;
  #deformed: boolean;
  #dirty = true;
  #step = -1;

  constructor(scene: Container, images: Container | null, whole: boolean) {
    const canvas = element<HTMLCanvasElement>("#stage");
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: false });
    this.renderer.autoClear = false;
    this.whole = whole || this.renderer.capabilities.maxVertexTextures === 0;
    this.#deformed = !this.whole;
    this.tissue = tissue(scene, images, this.whole);
    const { header } = this.tissue;
    const [entry, target] = [new Vector3(...header.plan.entry_lps_mm), new Vector3(...header.plan.target_lps_mm)];
    this.world = new World(element("#scene"), header, this.tissue.surfaces, () => (this.#dirty = true));
    this.#eye = new Eye(element("#eye"), this.world);
    this.#cross = target.clone();
    this.#axis = target.sub(entry).normalize();
    this.slices = SLICES.map(({ id, title, facing, oblique }) => this.#slice(id, title, facing, oblique));
    this.#turn(this.#axis, this.#cross);
    this.#place(this.#cross);
    new ResizeObserver(() => this.resize()).observe(canvas);
    element("main").addEventListener("scroll", () => this.touch());
    this.resize();
  }

  #slice(id: string, title: string, facing: Facing, oblique: boolean): SlicePane {
    return new SlicePane(element(`#${id}`), title, new Slice(facing, this.tissue), oblique, {
      cross: (p) => {
        this.onFree?.();
        this.#place(p);
      },
      crossed: () => this.#cross.clone(),
      changed: () => (this.#dirty = true),
    });
  }

  /** Fits the drawing to its place on the page. */
  resize(): void {
    // Glasses have a size of their own.
    if (this.renderer.xr.isPresenting) return;
    const canvas = this.renderer.domElement;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(canvas.clientWidth, canvas.clientHeight, false);
    this.#dirty = true;
  }

  /** The point at which the slices cross. */
  get crosshair(): Vector3 {
    return this.#cross.clone();
  }

  /** Puts the crosshair of all slices at a point. */
  #place(p: Vector3): void {
    this.#cross.copy(p);
    for (const s of this.slices) {
      s.slice.cross(p, !s.oblique);
      s.label();
    }
    this.#dirty = true;
  }

  /** Lays the oblique slices along the catheter, its tip in the middle. */
  #turn(axis: Vector3, tip: Vector3): void {
    this.#axis.copy(axis);
    for (const [i, s] of this.slices.entries()) {
      if (!s.oblique) continue;
      s.slice.plane.along(axis, SLICES[i]!.facing);
      s.slice.plane.centre.copy(tip);
      s.slice.touch();
      s.label();
    }
  }

  window(centre: number, width: number): void {
    this.tissue.ct.window.value.set(centre, width);
    this.#dirty = true;
  }

  setVisible(name: SurfaceName, visible: boolean): void {
    this.world.setVisible(name, visible);
    this.#dirty = true;
  }

  setColoured(coloured: boolean): void {
    this.world.setColoured(coloured);
    this.#dirty = true;
  }

  /** Whether the slices show the CT deformed with the tissue, or as it was scanned. */
  setDeformed(deformed: boolean): void {
    this.#deformed = deformed && !this.whole;
    this.#dirty = true;
  }

  get deformed(): boolean {
    return this.#deformed;
  }

  setOutlines(shown: boolean): void {
    this.slices.forEach(({ slice }) => slice.setOutlines(shown));
    this.#dirty = true;
  }

  take(snapshot: Snapshot): void {
    if (snapshot.step !== this.#step) this.#move(snapshot);
    this.see(snapshot.guidance);
  }

  #move(snapshot: Snapshot): void {
    this.#step = snapshot.step;
    if (snapshot.whole) moveVertices(this.tissue.surfaces, snapshot);
    else this.tissue.displacement.take(snapshot);
    this.slices.forEach(({ slice }) => slice.touch());
  }

  /** Shows catheter and target where they are seen, and not where they are not. */
  see(seen: Seen = NOTHING): void {
    this.world.take(seen);
    this.#eye.take(seen);
    this.slices.forEach(({ slice }) => slice.take(seen));
    this.#followNeedle(seen);
    this.#dirty = true;
  }

  #followNeedle({ tip_lps_mm: tip, axis_lps: axis }: Seen): void {
    if (!tip || !axis) return;
    this.#turn(new Vector3(...axis), new Vector3(...tip));
    if (this.follow) this.#place(new Vector3(...tip));
  }

  /** The window's layout has changed. */
  touch(): void {
    this.#dirty = true;
  }

  /** Draws what has changed; returns whether anything was drawn. */
  draw(): boolean {
    if (!this.#dirty) return false;
    this.#dirty = false;
    const r = this.renderer;
    const seen = this.slices.filter(({ pane }) => pane.clientWidth > 0);
    // Outlines always belong to the slice and the tissue that are shown, however slow the machine is.
    for (const { slice, pane } of seen) slice.prepare(r, ...this.#deviceSize(pane));
    r.setScissorTest(true);
    this.#rectangle(element("#scene"), (aspect) => this.world.draw(r, aspect));
    this.#rectangle(element("#eye"), (aspect) => this.#eye.draw(r, aspect));
    for (const { slice, pane } of seen) this.#rectangle(pane, () => slice.draw(r, this.#deformed));
    // Last: some layouts inset it.
    this.#rectangle(element("#tip"), (aspect) => this.world.drawTip(r, aspect));
    r.setScissorTest(false);
    return true;
  }

  #deviceSize(p: HTMLElement): [number, number] {
    const ratio = this.renderer.getPixelRatio();
    return [Math.max(1, Math.round(p.clientWidth * ratio)), Math.max(1, Math.round(p.clientHeight * ratio))];
  }

  #rectangle(p: HTMLElement, draw: (aspect: number) => void): void {
    const [box, stage] = [p.getBoundingClientRect(), this.renderer.domElement.getBoundingClientRect()];
    // Without the border, so that a slice has the pixels that it was cut for.
    const [width, height] = [p.clientWidth, p.clientHeight];
    if (width < 1 || height < 1) return;
    const rectangle = [box.left + p.clientLeft - stage.left, stage.bottom - box.top - p.clientTop - height, width, height] as const;
    this.renderer.setViewport(...rectangle);
    this.renderer.setScissor(...rectangle);
    this.renderer.clear();
    draw(width / height);
  }
}

/** Says over all views why they are empty. */
function say(text: string): void {
  const said = element("#no-picture");
  said.textContent = text;
  said.hidden = text === "";
}

/** The stage; `null`, and said on the page, where the browser cannot draw. */
export function openStage(scene: Container, images: Container | null, whole: boolean): Stage | null {
  try {
    const stage = new Stage(scene, images, whole);
    const canvas = stage.renderer.domElement;
    canvas.addEventListener("webglcontextlost", () => say("The graphics card has dropped the pictures. The numbers go on; the pictures come back by themselves, or when the page is loaded again."));
    canvas.addEventListener("webglcontextrestored", () => {
      say("");
      stage.touch();
    });
    return stage;
  } catch (error) {
    say(`This browser cannot draw here (WebGL 2): ${error instanceof Error ? error.message : String(error)} The numbers go on without pictures.`);
    return null;
  }
}

function tissue(scene: Container, images: Container | null, whole: boolean): Tissue {
  const header = scene.header as SceneHeader;
  const displacement = new Displacement(scene.floats(header.nodes_at, 3 * header.node_count));
  return {
    header, displacement, ct: ct(images), tets: scene.words(header.tets_at, 4 * header.tet_count),
    surfaces: surfaces(scene, displacement.texture, whole),
  };
}
