// The guidance panel. Live, stale and lost differ in colour, shape and text; numbers vanish when lost.

import type { Guidance, Status } from "./api";
import { element, make, write } from "./dom";
import { STALE_MS } from "./snapshot";
import { SHAPES, WORDS } from "./state";

const PHASES: Record<Guidance["phase"], string> = {
  no_case: "No case",
  case: "Calibrate the catheter",
  calibrated: "Register the patient",
  registered: "Check a landmark",
  checked: "Ready to navigate",
  navigating: "Navigating",
};

type Row = [id: string, label: string, text: (g: Guidance) => string | null];

const mm = (v: number | null): string | null => (v === null ? null : `${v.toFixed(1)} mm`);
const ms = (v: number | null): string | null => (v === null ? null : `${v.toFixed(0)} ms`);
const ROWS: Row[] = [
  ["distance", "To target (deformed)", (g) => mm(g.distance_to_target_mm)],
  ["tissue", "Age of the deformation", (g) => (g.distance_to_target_mm === null ? null : ms(g.deformation_age_ms))],
  ["rigid", "To target (rigid)", (g) => mm(g.distance_to_target_rigid_mm)],
  ["angle", "Entry angle error", (g) => (g.entry_angle_error_deg === null ? null : `${g.entry_angle_error_deg.toFixed(1)}°`)],
  ["offset", "Entry offset", (g) => mm(g.entry_offset_mm)],
  ["depth", "Depth", (g) => mm(g.depth_mm)],
  ["miss", "Line misses target by", (g) => mm(g.miss_mm)],
  ["force", "Force along the shaft", (g) => (g.axial_force_mn === null ? null : `${g.axial_force_mn.toFixed(0).replace("-", "−")} mN`)],
  ["ventricle", "In ventricle", (g) => (g.in_ventricle === null ? null : g.in_ventricle ? "yes" : "no")],
  ["csf", "CSF came at a depth of", (g) => mm(g.csf_depth_mm)],
  ["tip", "Tip in", (g) => (g.in_ventricle === null ? null : (g.tip_in ?? "outside of the brain").replaceAll("_", " "))],
  ["grade", "Predicted Kakarla grade", (g) => g.kakarla_grade?.toString() ?? null],
  ["tre", "Predicted TRE", (g) => (g.state === "lost" ? null : mm(g.predicted_tre_mm))],
];

/** Whether it is known where the patient is in the frame of the reference. */
export const isRegistered = ({ phase }: Guidance): boolean => phase === "registered" || phase === "checked" || phase === "navigating";

/** One or two elements beside a shaft change little. */
const MANY_CRUSHED = 3;

/** What must not be missed of the numbers, with a way out. */
function alarm(g: Guidance): string {
  const { reference_moved_mm: moved, reference_turned_deg: turned, tissue_doubt: doubt, crushed_elements: crushed, solver_fault: fault, solver_faults: faults } = g;
  // Either raises the alarm: a turn does where nothing has shifted.
  if (moved !== null) return `The reference has moved by ${moved.toFixed(1)} mm and turned by ${(turned ?? 0).toFixed(1)}°: check a landmark or register again.`;
  if (doubt !== null) return `What is drawn of the tissue is no result: ${doubt}.`;
  if (!fault && crushed >= MANY_CRUSHED) return `${crushed} elements of the soft body are crushed: how far walls have moved around them is a matter of chance.`;
  return fault ? `The soft body had a fault and went back to its last good state (${faults} so far): deformed values may be behind.` : "";
}

/** What is wrong though poses come: one that is frozen or defined anew, nothing recorded any more. */
export const trouble = ({ tracker_trouble, recording_trouble }: Status): string => [tracker_trouble, recording_trouble].filter(Boolean).join(" ");

/** All that must not be missed: of the numbers, and of where they come from. */
export const warning = (g: Guidance, trouble: string): string => [alarm(g), trouble].filter(Boolean).join(" ");

export class Panel {
  readonly #signal = element("#signal");
  readonly #alarm = element("#alarm");
  readonly #why = element("#why");
  readonly #faults = element("#faults");
  readonly #atTip = element("#tip-distance");
  readonly #cells: HTMLElement[];
  /** How the tracker is, and what is wrong though poses come. */
  #diagnosis = "";
  #trouble = "";

  constructor() {
    const list = element("#numbers");
    this.#cells = ROWS.map(([id, label], i) => {
      const [term, value] = [make("dt", { textContent: label }), make("dd", { id: `n-${id}` })];
      list.append(make("div", { className: i === 0 ? "first" : "" }, term, value));
      return value;
    });
  }

  show(guidance: Guidance): void {
    ROWS.forEach(([, , text], i) => {
      const cell = this.#cells[i];
      if (cell) write(cell, text(guidance) ?? "–");
    });
    element("#n-tissue").classList.toggle("old", (guidance.deformation_age_ms ?? 0) > STALE_MS);
    const why = [guidance.why_no_numbers, guidance.state === "live" ? null : this.#diagnosis].filter(Boolean).join(". ");
    write(this.#why, why);
    this.#why.hidden = why === "";
    write(this.#alarm, warning(guidance, this.#trouble));
    this.#alarm.hidden = !this.#alarm.textContent;
    write(this.#faults, `The soft body has taken back ${guidance.solver_faults} ${guidance.solver_faults === 1 ? "step" : "steps"} so far.`);
    this.#faults.hidden = guidance.solver_faults === 0;
    write(this.#atTip, mm(guidance.distance_to_target_mm) ?? "");
    this.#state(guidance.state, PHASES[guidance.phase], guidance.age_ms);
  }

  /** Takes what the server says of itself, to be shown with the next numbers. */
  tell(status: Status): void {
    [this.#diagnosis, this.#trouble] = [status.tracker_diagnosis, trouble(status)];
  }

  /** No connection: nothing that is shown can be trusted. */
  gone(): void {
    for (const cell of this.#cells) write(cell, "–");
    write(this.#atTip, "");
    this.#why.hidden = true;
    this.#state("lost", "No connection to the server", null);
  }

  #state(state: Guidance["state"], phase: string, age: number | null): void {
    if (this.#signal.dataset["state"] !== state || this.#signal.dataset["phase"] !== phase) {
      this.#signal.dataset["state"] = state;
      this.#signal.dataset["phase"] = phase;
      this.#signal.className = state;
      this.#signal.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${SHAPES[state]}"/></svg><span role="status"></span><small aria-hidden="true"></small>`;
    }
    const [word, small] = [this.#signal.querySelector("span"), this.#signal.querySelector("small")];
    if (word) word.textContent = WORDS[state];
    const old = age === null ? "" : age < 1000 ? ` · ${age.toFixed(0)} ms` : ` · ${(age / 1000).toFixed(1)} s`;
    if (small) small.textContent = phase + old;
  }
}
