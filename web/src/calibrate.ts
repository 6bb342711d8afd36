// The calibration page: the catheter is swung about its resting tip, then turned about its axis; what the server finds of
// both, with its errors, or why it refuses. The rules are the server's.

import { type Api, type Calibration } from "./api";
import { element, make, write } from "./dom";

/** How long a motion is watched, s. */
const WATCHED_S = 10;

type Row = [term: string, value: string];

function facts({ tip, axis }: Calibration): Row[] {
  const rows: Row[] = [];
  if (tip) {
    rows.push(["Tip, in the tool's frame", `${tip.tip_mm.map((v) => v.toFixed(1)).join(", ")} mm`]);
    rows.push(["Known to (one sigma)", `${tip.tip_sigma_mm.toFixed(2)} mm`], ["Residual of one pose, RMS", `${tip.residual_mm.toFixed(2)} mm`]);
    rows.push(["Covered: tilt about the stiffest axis, RMS", `${tip.tilt_deg.toFixed(0)}°`], ["Poses used", `${tip.used} of ${tip.poses}`]);
    if (tip.remark) rows.push(["⚠ Look", tip.remark]);
  }
  if (axis) rows.push(["Axis known to (one sigma)", `${axis.axis_sigma_deg.toFixed(2)}°`], ["Wobble, RMS", `${axis.wobble_deg.toFixed(2)}°`]);
  return rows;
}

export class Calibrate {
  readonly #api: Api;
  readonly #said = element("#calibrate-said");
  readonly #buttons: { button: HTMLButtonElement; may: (c: Calibration) => boolean }[] = [];
  #last: Calibration | null = null;

  constructor(api: Api) {
    this.#api = api;
    this.#action("Pivot about the tip", () => true, "pivot", "Tip resting in a divot, swing the hub in a cone, in all directions");
    this.#action("Turn about the axis", (c) => c.tip !== null, "turn", "Shaft resting in a guide, turn it about itself");
    this.#action("Accept calibration", (c) => c.tip !== null && c.axis !== null && c.phase !== "navigating", "accept");
    this.#button("Catheter was changed", (c) => c.phase !== "no_case" && c.phase !== "case", () => void this.#changed());
    element("#layout").addEventListener("click", () => {
      // It may have changed elsewhere.
      if (element("main").dataset["layout"] === "calibrate") void this.#do(() => api.calibration());
    });
  }

  #action(text: string, may: (c: Calibration) => boolean, action: "pivot" | "turn" | "accept", motion?: string): void {
    this.#button(text, may, () => void this.#act(action, motion));
  }

  #button(text: string, may: (c: Calibration) => boolean, act: () => void): void {
    const button = make("button", { textContent: text, disabled: true });
    button.onclick = act;
    this.#buttons.push({ button, may });
    element("#calibrate-actions").append(button);
  }

  /** Another catheter has another tip: nothing that was found or touched holds. */
  async #changed(): Promise<void> {
    const done = await this.#do(() => this.#api.event("tool_changed").then(() => this.#api.calibration()));
    if (done) this.#say("Pivot the new one about its tip; landmarks are to be touched again.");
  }

  async #act(action: "pivot" | "turn" | "accept", motion?: string): Promise<void> {
    if (!motion) {
      if (await this.#do(() => this.#api.calibrate(action))) this.#say("✓ Accepted. Register the patient; landmarks touched before are to be touched again.", "good");
      return;
    }
    for (const { button } of this.#buttons) button.disabled = true;
    const end = performance.now() + 1000 * WATCHED_S;
    const tell = (): void => this.#say(`${motion}: ${Math.max(0, Math.ceil((end - performance.now()) / 1000))} s`);
    tell();
    const clock = setInterval(tell, 250);
    const found = await this.#do(() => this.#api.calibrate(action, WATCHED_S).finally(() => clearInterval(clock)));
    if (found) this.#say("✓ Found.", "good");
    else if (this.#last) this.#enable(this.#last);
    else this.#buttons[0]!.button.disabled = false;
  }

  /** Does something and shows what is then; a refusal is shown too, with its way out. */
  async #do(act: () => Promise<Calibration>): Promise<boolean> {
    try {
      this.#last = await act();
    } catch (error) {
      this.#say(`✗ ${error instanceof Error ? error.message : String(error)}`, "bad");
      return false;
    }
    this.#enable(this.#last);
    const rows = facts(this.#last).map(([term, value]) => make("div", {}, make("dt", { textContent: term }), make("dd", { textContent: value })));
    element("#calibrate-facts").replaceChildren(...rows);
    return true;
  }

  #enable(c: Calibration): void {
    for (const { button, may } of this.#buttons) button.disabled = !may(c);
  }

  #say(text: string, kind = ""): void {
    this.#said.className = `said ${kind}`;
    write(this.#said, text);
  }
}
