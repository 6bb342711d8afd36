// Where the time of a frame goes: each stage with its rate, its mean time and its share of a 60th of a second.

import type { Status } from "./api";
import { element, make, write } from "./dom";

/** What a stage may take, ms: the frame of an ordinary screen. */
const FRAME_MS = 1000 / 60;

/** Counts events and their time. */
export class Counter {
  #count = 0;
  #sum = 0;
  #since = performance.now();

  tick(ms = 0): void {
    this.#count++;
    this.#sum += ms;
  }

  /** Events a second and mean ms since the last call. */
  take(): { hz: number; ms: number } {
    const now = performance.now();
    const out = { hz: (1000 * this.#count) / (now - this.#since), ms: this.#count ? this.#sum / this.#count : 0 };
    [this.#count, this.#sum, this.#since] = [0, 0, now];
    return out;
  }
}

export interface Stages {
  /** Decoding a snapshot and moving what it moves. */
  take: Counter;
  /** Cutting and drawing all panes; what the GPU does later is not in it. */
  draw: Counter;
}

type Row = { name: string; hz: number; ms: number };

export class Budget {
  readonly #table = element<HTMLTableElement>("#budget");
  readonly #rows = new Map<string, HTMLTableRowElement>();

  show(status: Status, stages: Stages): void {
    const rows: Row[] = [
      { name: "Tracking", hz: status.tracking_hz, ms: status.tracking_ms },
      { name: "Soft body", hz: status.deformation_hz, ms: status.deformation_ms },
      { name: "Sending", hz: status.snapshot_hz, ms: status.snapshot_ms },
      { name: "Taking", ...stages.take.take() },
      { name: "Drawing", ...stages.draw.take() },
    ];
    for (const row of rows) this.#row(row);
    this.#table.title = `${status.displays} display${status.displays === 1 ? "" : "s"}; bars are parts of ${FRAME_MS.toFixed(1)} ms`;
  }

  #row({ name, hz, ms }: Row): void {
    let row = this.#rows.get(name);
    if (!row) {
      row = this.#table.insertRow();
      row.append(make("th", { textContent: name, scope: "row" }), make("td"), make("td"), make("td", {}, make("meter", { max: FRAME_MS, high: FRAME_MS * 0.99 })));
      this.#rows.set(name, row);
    }
    const [, rate, time, bar] = row.cells as unknown as [HTMLElement, HTMLElement, HTMLElement, HTMLElement];
    write(rate, `${hz.toFixed(0)} Hz`);
    write(time, `${ms.toFixed(1)} ms`);
    row.classList.toggle("late", ms > FRAME_MS);
    const meter = bar.querySelector("meter");
    if (meter) meter.value = ms;
  }
}
