// Glasses: the patient in the room, by immersive-ar, else immersive-vr on black, else on the screen only.

import { Matrix4, PerspectiveCamera, Vector3 } from "three";
import type { Guidance, Status } from "../api";
import { element, make, write } from "../dom";
import { isRegistered, trouble } from "../panel";
import type { Stage } from "../view/stage";
import { Anchor } from "./anchor";
import { Panels } from "./panels";

type Mode = "immersive-ar" | "immersive-vr";
const MODES: Record<Mode, string> = { "immersive-ar": "Show in the room", "immersive-vr": "Show on black" };

export class Glasses {
  readonly anchor: Anchor;
  /** In metres; the glasses set everything but what is nearest and farthest. */
  readonly #camera = new PerspectiveCamera(50, 1, 0.05, 20);
  readonly #stage: Stage;
  /** Called in each frame of the glasses, before it is drawn. */
  readonly #onFrame: () => void;
  readonly #start = make("button", { disabled: true, textContent: "Start" });
  readonly #place = make("button", { textContent: "Place before me" });
  readonly #track = make("button", { textContent: "Place by tracker" });
  readonly #said = make("output");
  #panels: Panels | null = null;
  #guidance: Guidance | null = null;
  #trouble = "";

  constructor(stage: Stage, onFrame: () => void) {
    this.#stage = stage;
    this.#onFrame = onFrame;
    this.anchor = new Anchor(new Vector3(...stage.tissue.header.plan.target_lps_mm));
    this.#place.onclick = () => this.anchor.lift();
    this.#track.onclick = () => this.anchor.track();
    this.#place.hidden = this.#track.hidden = true;
    element("#glasses").append(this.#start, this.#place, this.#track, this.#said);
    navigator.xr?.addEventListener("devicechange", () => void this.#offer());
    void this.#offer();
  }

  /** The panels before the wearer's eyes, while there is one. */
  get panels(): Panels | null {
    return this.#panels;
  }

  get presenting(): boolean {
    return this.#panels !== null;
  }

  /** Takes what is known of catheter and glasses; `null` when the server is gone. */
  take(guidance: Guidance | null): void {
    this.#guidance = guidance;
    if (guidance && !isRegistered(guidance)) this.anchor.void();
    this.anchor.see(guidance?.display_from_patient ?? null, guidance?.display_age_ms ?? 0);
  }

  /** Takes what the server says of itself, to be shown with the next numbers. */
  tell(status: Status): void {
    this.#trouble = trouble(status);
  }

  async #offer(): Promise<void> {
    if (this.presenting) return;
    const supported = async (mode: Mode): Promise<boolean> => (await navigator.xr?.isSessionSupported(mode).catch(() => false)) ?? false;
    const mode = (await supported("immersive-ar")) ? "immersive-ar" : (await supported("immersive-vr")) ? "immersive-vr" : null;
    this.#start.hidden = mode === null;
    write(this.#said, mode ? "" : isSecureContext ? "None here: shown on this screen." : "Glasses need HTTPS.");
    if (!mode) return;
    write(this.#start, MODES[mode]);
    this.#start.disabled = false;
    this.#start.onclick = () => void this.#enter(mode);
  }

  async #enter(mode: Mode): Promise<void> {
    const { renderer, world } = this.#stage;
    if (!navigator.xr) return;
    this.#start.disabled = true;
    try {
      const session = await navigator.xr.requestSession(mode, { optionalFeatures: ["local-floor"] });
      renderer.xr.enabled = true;
      renderer.xr.setReferenceSpaceType("local");
      await renderer.xr.setSession(session);
      session.addEventListener("end", () => this.#leave());
      // A pinch, a click, a tap.
      session.addEventListener("select", () => (this.anchor.placing ? this.anchor.drop() : this.anchor.kind === "manual" && this.anchor.lift()));
      this.#panels = new Panels(this.#stage);
      world.scene.add(this.#panels.group);
      this.#showing(true, () => void session.end());
      renderer.setAnimationLoop((_, frame: XRFrame | undefined) => frame && this.#draw(frame));
    } catch (error) {
      this.#showing(false, () => void this.#enter(mode));
      write(this.#said, `The glasses refused: ${error instanceof Error ? error.message : String(error)}`);
    }
  }

  #showing(on: boolean, click: () => void): void {
    this.#place.hidden = this.#track.hidden = !on;
    this.#start.disabled = false;
    this.#start.onclick = click;
    if (on) write(this.#start, "End");
    document.body.classList.toggle("in-glasses", on);
  }

  #leave(): void {
    const { renderer, world } = this.#stage;
    renderer.setAnimationLoop(null);
    renderer.xr.enabled = false;
    renderer.autoClear = false;
    if (this.#panels) world.scene.remove(this.#panels.group);
    this.#panels?.dispose();
    this.#panels = null;
    world.place(new Matrix4());
    this.#showing(false, () => undefined);
    this.#stage.resize();
    void this.#offer();
  }

  #draw(frame: XRFrame): void {
    const { renderer, world } = this.#stage;
    const space = renderer.xr.getReferenceSpace();
    const pose = space && frame.getViewerPose(space);
    const panels = this.#panels;
    if (!pose || !panels) return;
    const roomFromViewer = new Matrix4().fromArray(pose.transform.matrix);
    this.anchor.look(roomFromViewer);
    this.#onFrame();
    panels.write(this.#guidance, this.#trouble, this.anchor);
    world.place(new Matrix4());
    panels.group.visible = false;
    panels.draw(renderer);
    panels.group.visible = true;
    panels.group.matrix.copy(roomFromViewer);
    panels.group.matrixWorldNeedsUpdate = true;
    world.place(this.anchor.roomFromPatient);
    // Nothing is drawn of a patient whose place was never known.
    world.patient.visible = this.anchor.kind === "manual" || this.anchor.placedAt !== null;
    renderer.autoClear = true;
    renderer.render(world.scene, this.#camera);
    world.patient.visible = true;
  }
}
