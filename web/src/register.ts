// The registration page: landmarks are touched with the catheter's tip, solved for, accepted, checked. The rules are the
// server's; here they are shown.

import { Vector3 } from "three";
import { type Api, type LandmarkState, type Point, type Registration } from "./api";
import { element, make, write } from "./dom";
import type { Stage } from "./view/stage";

const HINTS: Record<Registration["phase"], string> = {
  no_case: "There is no case yet.",
  case: "Calibrate the catheter first (its tip must be known).",
  calibrated: "Hold the tip still on a landmark and press Touch; three landmarks at least, far apart.",
  registered: "Touch a landmark again and press Check before you navigate.",
  checked: "Checked. Navigation can start.",
  navigating: "Navigating. A landmark can be checked again at any time.",
};
const mm = (v: number | null): string => (v === null ? "–" : `${v.toFixed(1)} mm`);

export class Register {
  readonly #api: Api;
  readonly #stage: Stage;
  readonly #said = element("#register-said");
  readonly #buttons: { button: HTMLButtonElement; may: (r: Registration) => boolean }[] = [];
  readonly #name = make("input", { placeholder: "name", maxLength: 40 });
  readonly #mark = make("button", { textContent: "Mark on the skin" });
  #placing = false;

  constructor(api: Api, stage: Stage) {
    [this.#api, this.#stage] = [api, stage];
    const accepted = ["registered", "checked", "navigating"];
    this.#action("Accept", (r) => r.predicted_tre_mm !== null && r.phase !== "navigating" && r.phase !== "case", () => api.register("accept"));
    this.#action("Start navigation", (r) => r.phase === "checked", () => this.#event("started"));
    this.#action("Stop navigation", (r) => r.phase === "navigating", () => this.#event("stopped"));
    this.#action("Reference was moved", (r) => accepted.includes(r.phase), () => this.#event("reference_moved"));
    this.#name.setAttribute("aria-label", "Name of the new landmark");
    this.#mark.onclick = () => this.#place(!this.#placing);
    element("#register-mark").append(this.#name, this.#mark);
    element("#scene").addEventListener("pointerdown", (e) => this.#pick(e), true);
    element("#scene").addEventListener("keydown", (e) => this.#placing && e.key === "Enter" && this.#markAt(0, 0));
    element("#layout").addEventListener("click", () => {
      const shown = element("main").dataset["layout"] === "register";
      stage.world.showMarks(shown);
      stage.touch();
      // It may have changed elsewhere.
      if (shown) void this.#do(() => api.registration());
    });
  }

  #action(text: string, may: (r: Registration) => boolean, act: () => Promise<Registration>): void {
    const button = make("button", { textContent: text });
    button.onclick = () => void this.#do(act);
    this.#buttons.push({ button, may });
    element("#register-actions").append(button);
  }

  async #event(event: string): Promise<Registration> {
    await this.#api.event(event);
    return this.#api.registration();
  }

  /** Does something and shows what is then; a refusal is shown too, with its way out. */
  async #do(act: () => Promise<Registration>, waiting = ""): Promise<void> {
    this.#say(waiting);
    try {
      this.#show(await act());
    } catch (error) {
      this.#say(error instanceof Error ? error.message : String(error), "bad");
    }
  }

  #say(text: string, kind = ""): void {
    this.#said.className = `said ${kind}`;
    write(this.#said, text);
  }

  #show(r: Registration): void {
    write(element("#register-hint"), HINTS[r.phase]);
    write(element("#register-tre"), mm(r.predicted_tre_mm));
    element("#marks tbody").replaceChildren(...r.landmarks.map((l) => this.#row(l, r.phase)));
    for (const { button, may } of this.#buttons) button.disabled = !may(r);
    this.#stage.world.mark(r.landmarks.map((l) => ({ at: new Vector3(...l.marked_lps_mm), touched: l.touched })));
    this.#stage.touch();
    const { checked } = r;
    if (checked) {
      const text = `${checked.name}: ${mm(checked.distance_mm)} off, at most ${mm(checked.limit_mm)} explained by noise`;
      const hidden = checked.hidden_motion_mm;
      const why = hidden === null ? "Register again." : `That does not tell whether the reference moved by ${mm(hidden)} on the patient: register again.`;
      this.#say(checked.holds ? `✓ ${text}. The registration holds.` : `✗ ${text}. ${why}`, checked.holds ? "good" : "bad");
    } else this.#say(r.landmarks.some((l) => l.touched) ? [r.why_not, ...r.remarks].filter(Boolean).join(" ") : "", r.remarks.length ? "bad" : "");
  }

  #row(l: LandmarkState, phase: Registration["phase"]): HTMLTableRowElement {
    const button = (text: string, action: string): HTMLButtonElement => {
      const made = make("button", { textContent: text });
      made.setAttribute("aria-label", `${text} ${l.name}`);
      const waits = action === "touch" || action === "check" ? "Hold still …" : "";
      made.onclick = () => void this.#do(() => this.#api.register(action, { name: l.name }), waits);
      return made;
    };
    const buttons = [button(l.touched ? "Touch again" : "Touch", "touch")];
    if (l.touched) buttons.push(button("Forget", "forget"));
    if (["registered", "checked", "navigating"].includes(phase)) buttons.push(button("Check", "check"));
    if (l.added) buttons.push(button("Remove", "unmark"));
    const row = make("tr", {},
      make("td", { textContent: l.name }), make("td", { textContent: mm(l.left_out_mm ?? l.residual_mm) }),
      make("td", { textContent: mm(l.expected_mm) }), make("td", {}, ...buttons.flatMap((b) => [b, " "])));
    row.classList.toggle("touched", l.touched);
    row.classList.toggle("outlier", l.outlier);
    return row;
  }

  #place(on: boolean): void {
    this.#placing = on;
    this.#mark.setAttribute("aria-pressed", String(on));
    this.#say(on ? "Click on the skin in the 3D view; or turn it with the arrow keys until the place is at the cross, and press Enter." : "");
    element("#scene").classList.toggle("placing", on);
    if (on) element("#scene").focus();
  }

  /** A click on the skin while a landmark is to be placed. */
  #pick(e: PointerEvent): void {
    if (!this.#placing || e.button !== 0) return;
    e.stopImmediatePropagation();
    const pane = element("#scene");
    const box = pane.getBoundingClientRect();
    const [x, y] = [e.clientX - box.left - pane.clientLeft, e.clientY - box.top - pane.clientTop];
    this.#markAt((2 * x) / pane.clientWidth - 1, 1 - (2 * y) / pane.clientHeight);
  }

  /** Marks the point of the skin that is seen at a place of the 3D view (-1 to 1, right and up). */
  #markAt(x: number, y: number): void {
    const at = this.#stage.world.skinAt(x, y);
    if (!at) return;
    this.#place(false);
    const name = this.#name.value.trim();
    void this.#do(() => this.#api.register("mark", { name, position_lps_mm: at.toArray() as Point }));
  }
}
