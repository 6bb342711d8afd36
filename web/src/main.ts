// Opens the session and keeps panel and stage up to date.

import { Api, Unauthorized, type Case, type Status } from "./api";
import { controls } from "./controls";
import { Panel } from "./panel";
import type { Snapshot } from "./snapshot";
import { Stream } from "./stream";
import { askForToken, tokenAtHand } from "./token";
import { Stage } from "./view/stage";

/** How often rates are shown, ms. */
const BUDGET_MS = 1000;

async function open(): Promise<{ api: Api; opened: Case }> {
  let token = tokenAtHand() ?? (await askForToken("Open this page with the address that Monro printed, or enter its token."));
  for (;;) {
    try {
      const api = new Api(token);
      return { api, opened: await api.case() };
    } catch (error) {
      if (!(error instanceof Unauthorized)) throw error;
      token = await askForToken(error.message);
    }
  }
}

function write(id: string, text: string): void {
  const element = document.getElementById(id);
  if (element) element.textContent = text;
}

function describe(opened: Case, status: Status): void {
  write("patient", opened.pseudonym);
  write("side", `${opened.side.toUpperCase()} SIDE`);
  write("tracker", status.simulated ? "Simulated tracker, exact registration" : status.tracker);
  document.title = `${opened.pseudonym} · Monro`;
}

/** Counts events a second. */
class Counter {
  #count = 0;
  #sum = 0;
  tick(ms = 0): void {
    this.#count++;
    this.#sum += ms;
  }
  /** Mean, and count since the last call. */
  take(): [count: number, mean: number] {
    const out: [number, number] = [this.#count, this.#count ? this.#sum / this.#count : 0];
    this.#count = this.#sum = 0;
    return out;
  }
}

async function main(): Promise<void> {
  const panel = new Panel();
  const { api, opened } = await open();
  describe(opened, await api.status());
  const images = opened.has_ct ? await api.container("/api/ct") : null;
  const stage = new Stage(await api.container("/api/scene"), images);
  controls(stage);
  const [frames, snapshots] = [new Counter(), new Counter()];
  let waiting: Snapshot | undefined;
  const stream = new Stream(api, (s) => (waiting = s), (error) => {
    panel.gone();
    if (error instanceof Unauthorized) location.reload();
  });
  const frame = (): void => {
    const start = performance.now();
    if (waiting) {
      stage.take(waiting);
      panel.show(waiting.guidance);
      waiting = undefined;
      snapshots.tick();
      stream.next();
    }
    if (stage.draw()) frames.tick(performance.now() - start);
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  setInterval(() => {
    const [[drawn, ms], [taken]] = [frames.take(), snapshots.take()];
    api.status().then((s) => panel.budget(s, drawn, taken, ms), () => undefined);
  }, BUDGET_MS);
}

void main();
