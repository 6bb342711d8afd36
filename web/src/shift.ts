// Brain shift: what is drained of the ventricles' fluid, how the head lies, and what comes of it.

import type { Api, Guidance, Point, Tissue } from "./api";
import { element, make, write } from "./dom";

const G_M_S2 = 9.81;
/** Where the Earth pulls, LPS. */
const POSTURES: Record<string, Point> = {
  "on its back": [0, 1, 0], "face down": [0, -1, 0], "on its left side": [1, 0, 0], "on its right side": [-1, 0, 0], "upright": [0, 0, -1],
};
const AS_SCANNED = "as in the scan";
const OTHER = "as set elsewhere";

/** The posture of a gravity, and the share of the Earth's, %. */
function posture(gravity: Point): [string, number] {
  const size = Math.hypot(...gravity);
  if (size === 0) return [AS_SCANNED, 100];
  const found = Object.entries(POSTURES).find(([, way]) => way.every((w, a) => Math.abs(w * size - gravity[a]!) < 1e-6));
  return [found?.[0] ?? OTHER, Math.round((100 * size) / G_M_S2)];
}

/** Nothing to a soft body without units; a viewer sees what there is and changes nothing. */
export class Shift {
  readonly #api: Api;
  readonly #came = make("output", { id: "shift-came" });
  readonly #said = make("p", { id: "shift-said", className: "said bad", hidden: true });
  readonly #drained = make("input", { type: "number", step: "1" });
  #filled = "";
  readonly #lies = make("select");
  readonly #share = make("input", { type: "number", min: "0", max: "200", step: "10" });

  constructor(api: Api, now: Tissue, changes: boolean) {
    this.#api = api;
    const parent = element("#shift");
    parent.hidden = now.mode !== "physical";
    this.#drained.setAttribute("aria-label", "Drained from the ventricles in all, ml");
    this.#drained.title = `Negative: infused. The ventricles hold ${now.ventricles_ml.toFixed(0)} ml in the scan.`;
    this.#lies.setAttribute("aria-label", "How the head lies");
    this.#share.setAttribute("aria-label", "Share of its weight that no fluid bears any more, %");
    this.#share.title = "Of its weight, what no fluid around the brain bears any more since the scan";
    const set = make("button", { textContent: "Set", onclick: () => void this.#set() });
    const held = make("small", { textContent: "The skull holds the surface of the brain (--skull slides lets it sink)." });
    held.hidden = now.skull !== "held";
    const inputs = [make("label", {}, "Drained ", this.#drained, " ml"), make("label", {}, "Lies ", this.#lies), make("label", {}, this.#share, " % of its weight"), set];
    parent.append(...(changes ? inputs : []), this.#came, this.#said, held);
    this.#fill(now);
  }

  #fill({ drain_ml, gravity_m_s2 }: Tissue): void {
    const [lies, share] = posture(gravity_m_s2);
    this.#drained.value = this.#filled = drain_ml === null ? "" : String(drain_ml);
    this.#lies.replaceChildren(...[AS_SCANNED, ...Object.keys(POSTURES), ...(lies === OTHER ? [OTHER] : [])].map((text) => make("option", { textContent: text })));
    this.#lies.value = lies;
    this.#share.valueAsNumber = share;
  }

  /** What is to be done, as the inputs say. */
  #wanted(): object {
    const [ml, percent, way] = [this.#drained.valueAsNumber, this.#share.valueAsNumber, POSTURES[this.#lies.value]];
    // What was left as it is stays, as a pressure that was given at the start does.
    const drained = this.#drained.value === this.#filled ? {} : { drain_ml: Number.isFinite(ml) ? ml : null };
    if (this.#lies.value === OTHER) return drained;
    const size = Number.isFinite(percent) ? (G_M_S2 * percent) / 100 : G_M_S2;
    return { ...drained, gravity_m_s2: (way ?? [0, 0, 0]).map((w) => w * size) };
  }

  async #set(): Promise<void> {
    try {
      this.#fill(await this.#api.load(this.#wanted()));
      this.#say("");
    } catch (error) {
      this.#say(error instanceof Error ? error.message : String(error));
    }
  }

  #say(why: string): void {
    write(this.#said, why);
    this.#said.hidden = why === "";
  }

  /** What came of it. */
  show({ drained_asked_ml: asked, drained_ml: ml, csf_pressure_change_mmhg: mmhg, target_shift_mm: shift }: Guidance): void {
    const drained = asked === null ? "" : `${ml.toFixed(1)} of ${asked.toFixed(1)} ml drained, ${mmhg.toFixed(1).replace("-", "−")} mmHg; `;
    write(this.#came, `${drained}target shifted by ${shift?.toFixed(1) ?? "–"} mm`);
  }

  /** No connection: nothing is known of it. */
  gone(): void {
    write(this.#came, "–");
  }
}
