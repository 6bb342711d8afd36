// The guidance panel. Live, stale and lost differ in colour, shape and text; numbers vanish when lost.

import type { Guidance, Status } from "./api";

const SHAPES = {
  live: "M12 2a10 10 0 1 0 0 20 10 10 0 0 0 0-20z",
  stale: "M12 2 23 21H1z",
  lost: "M5 2 2 5l7 7-7 7 3 3 7-7 7 7 3-3-7-7 7-7-3-3-7 7z",
} as const;
const WORDS = { live: "Live", stale: "Stale", lost: "Lost" } as const;
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
const ROWS: Row[] = [
  ["distance", "To target (deformed)", (g) => mm(g.distance_to_target_mm)],
  ["rigid", "To target (rigid)", (g) => mm(g.distance_to_target_rigid_mm)],
  ["angle", "Entry angle error", (g) => (g.entry_angle_error_deg === null ? null : `${g.entry_angle_error_deg.toFixed(1)}°`)],
  ["offset", "Entry offset", (g) => mm(g.entry_offset_mm)],
  ["depth", "Depth", (g) => mm(g.depth_mm)],
  ["miss", "Line misses target by", (g) => mm(g.miss_mm)],
  ["ventricle", "In ventricle", (g) => (g.in_ventricle === null ? null : g.in_ventricle ? "yes" : "no")],
  ["tip", "Tip in", (g) => (g.in_ventricle === null ? null : (g.tip_in ?? "outside the brain").replaceAll("_", " "))],
  ["grade", "Predicted Kakarla grade", (g) => g.kakarla_grade?.toString() ?? null],
  ["tre", "Predicted TRE", (g) => (g.state === "lost" ? null : mm(g.predicted_tre_mm))],
];

function element<T extends HTMLElement>(selector: string): T {
  const found = document.querySelector<T>(selector);
  if (!found) throw new Error(`The page has no ${selector}.`);
  return found;
}

export class Panel {
  readonly #signal = element("#signal");
  readonly #budget = element("#budget");
  readonly #cells: HTMLElement[];

  constructor() {
    const list = element("#numbers");
    this.#cells = ROWS.map(([id, label], i) => {
      const [term, value] = [document.createElement("dt"), document.createElement("dd")];
      term.textContent = label;
      value.id = `n-${id}`;
      for (const e of [term, value]) e.classList.toggle("first", i === 0);
      list.append(term, value);
      return value;
    });
  }

  show(guidance: Guidance): void {
    ROWS.forEach(([, , text], i) => {
      const cell = this.#cells[i];
      const shown = text(guidance) ?? "–";
      if (cell && cell.textContent !== shown) cell.textContent = shown;
    });
    this.#state(guidance.state, PHASES[guidance.phase], guidance.age_ms);
  }

  /** No connection: nothing that is shown can be trusted. */
  gone(): void {
    for (const cell of this.#cells) cell.textContent = "–";
    this.#state("lost", "No connection to the server", null);
  }

  budget(status: Status, framesPerSecond: number, snapshotsPerSecond: number, drawMs: number): void {
    this.#budget.textContent =
      `tracking ${status.tracking_hz.toFixed(0)} Hz · soft body ${status.deformation_hz.toFixed(0)} Hz` +
      ` (${status.deformation_ms.toFixed(1)} ms)\nsnapshots ${snapshotsPerSecond.toFixed(0)} Hz · ` +
      `screen ${framesPerSecond.toFixed(0)} Hz (${drawMs.toFixed(1)} ms) · displays ${status.displays}`;
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
