// Where the patient is in the room that the glasses know (WebXR's reference space, metres).

import { Matrix4, Quaternion, Vector3 } from "three";
import type { Rigid } from "../api";

const METRES = new Matrix4().makeScale(1e-3, 1e-3, 1e-3);
/** How long viewer poses are kept, ms. */
const HISTORY_MS = 1000;
/** From the eye to a patient that is placed by hand, m. */
const AHEAD_M = 0.6;
/** Placed by looking: the head rests for this long, ms, and turns less than this, rad. */
const DWELL_MS = 2000;
const STEADY_RAD = 0.03;

/** Patient axes (left, back, head) in a room with y up, for a viewer who looks along -z at the patient's face. */
const FACE_TO_FACE = new Matrix4().makeBasis(new Vector3(1, 0, 0), new Vector3(0, 0, -1), new Vector3(0, 1, 0));

interface Pose {
  time: number;
  roomFromViewer: Matrix4;
}

function matrix({ quaternion_wxyz: [w, x, y, z], translation_mm }: Rigid): Matrix4 {
  return new Matrix4().compose(new Vector3(...translation_mm), new Quaternion(x, y, z, w), new Vector3(1, 1, 1));
}

export type AnchorKind = "tracked" | "manual";

export class Anchor {
  /** Patient mm to the room's metres. */
  readonly roomFromPatient = new Matrix4();
  kind: AnchorKind = "tracked";
  /** When the tracker last placed it, ms. */
  placedAt: number | null = null;
  #placing = true;
  readonly #middle: Vector3;
  readonly #history: Pose[] = [];
  #restsSince = 0;
  readonly #restingView = new Vector3();

  /** `middle` is the point of the patient, mm, that is put in front of the eye when placed by hand. */
  constructor(middle: Vector3) {
    this.#middle = middle;
  }

  /** Whether a patient placed by hand still hangs before the eye. */
  get placing(): boolean {
    return this.kind === "manual" && this.#placing;
  }

  /** Share of the time that the head has to rest, 0 to 1. */
  get dwelled(): number {
    return this.placing ? Math.min(1, (performance.now() - this.#restsSince) / DWELL_MS) : 1;
  }

  /** Takes where the viewer is. */
  look(roomFromViewer: Matrix4): void {
    const time = performance.now();
    this.#history.push({ time, roomFromViewer: roomFromViewer.clone() });
    while (this.#history[0]!.time < time - HISTORY_MS) this.#history.shift();
    if (!this.placing) return;
    this.#hang(roomFromViewer);
    const view = new Vector3(0, 0, -1).transformDirection(roomFromViewer);
    if (view.angleTo(this.#restingView) > STEADY_RAD) {
      this.#restingView.copy(view);
      this.#restsSince = time;
    } else if (this.dwelled >= 1) this.#placing = false;
  }

  /** Forgets where the tracker placed it: the registration is void. */
  void(): void {
    this.placedAt = null;
  }

  /** Takes where calibrated glasses see the patient; the pose is `age` ms old: it belongs to where the viewer was then. */
  see(displayFromPatient: Rigid | null, age: number): void {
    if (this.kind !== "tracked" || !displayFromPatient) return;
    const then = performance.now() - age;
    const nearest = this.#history.reduce<Pose | null>((best, p) => (best && Math.abs(best.time - then) <= Math.abs(p.time - then) ? best : p), null);
    if (!nearest) return;
    this.roomFromPatient.copy(nearest.roomFromViewer).multiply(METRES).multiply(matrix(displayFromPatient));
    this.placedAt = then;
  }

  /** Lets it hang before the eye until the head rests. */
  lift(): void {
    [this.kind, this.#placing, this.#restsSince, this.placedAt] = ["manual", true, performance.now(), null];
  }

  /** Leaves it where it is now. */
  drop(): void {
    this.#placing = false;
  }

  /** Goes by the tracker from now on. */
  track(): void {
    this.kind = "tracked";
  }

  /** Upright, face to face, in front of the eye. */
  #hang(roomFromViewer: Matrix4): void {
    const view = new Vector3(0, 0, -1).transformDirection(roomFromViewer);
    const at = new Vector3().setFromMatrixPosition(roomFromViewer).addScaledVector(view, AHEAD_M);
    const yaw = new Matrix4().makeRotationY(Math.atan2(-view.x, -view.z));
    this.roomFromPatient.makeTranslation(at.x, at.y, at.z).multiply(yaw).multiply(FACE_TO_FACE).multiply(METRES)
      .multiply(new Matrix4().makeTranslation(-this.#middle.x, -this.#middle.y, -this.#middle.z));
  }
}
