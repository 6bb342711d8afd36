// Opens the session and keeps panel and stage up to date.

import { Unauthorized, type Api, type Case, type Guidance, type Status } from "./api";
import { Budget, Counter, type Stages } from "./budget";
import { Calibrate } from "./calibrate";
import { controls } from "./controls";
import { element, make } from "./dom";
import { offerInvitations } from "./invite";
import { Panel } from "./panel";
import { Register } from "./register";
import { Shift } from "./shift";
import { signIn } from "./sign_in";
import { aged, type Snapshot } from "./snapshot";
import { Stream } from "./stream";
import { openStage, type Stage } from "./view/stage";
import { Glasses } from "./xr/glasses";

/** How often rates are shown, ms. */
const BUDGET_MS = 1000;

function describe(opened: Case, status: Status): void {
  element("#patient").textContent = opened.pseudonym;
  element("#side").textContent = `${opened.side.toUpperCase()} SIDE`;
  element("#tracker").textContent = status.simulated ? "Simulated tracker, exact registration" : status.tracker;
  document.title = `${opened.pseudonym} · Monro`;
  document.body.classList.toggle("viewer", status.role !== "operator");
}

/** The report opens in a tab of its own: a ticket lets it in, for links carry no token. */
function offerReport(opened: Case, api: Api): void {
  const button = element<HTMLButtonElement>("#report");
  button.hidden = !opened.has_report;
  button.onclick = () => void api.ticket().then((ticket) => window.open(`/report?ticket=${ticket}`, "_blank", "noopener"));
}

/** Panel, stage and glasses with what has come last. */
class View {
  readonly panel = new Panel();
  readonly #shift: Shift;
  readonly stages: Stages = { take: new Counter(), draw: new Counter() };
  readonly stage: Stage | null;
  readonly glasses: Glasses | null;
  readonly #stream: Stream;
  /** What has come and is not drawn yet, and what was drawn last. */
  #waiting: Snapshot | undefined;
  #last: Snapshot | undefined;

  constructor(api: Api, stage: Stage | null, shift: Shift) {
    this.stage = stage;
    this.#shift = shift;
    this.glasses = stage && new Glasses(stage, () => this.#advance());
    this.#stream = new Stream(api, stage?.whole ?? false, (s) => (this.#waiting = s), () => void (this.#last && !this.#waiting && this.#show(this.#last)), (error) => this.#gone(error));
    const frame = (): void => {
      requestAnimationFrame(frame);
      // They have frames of their own.
      if (this.glasses?.presenting) return;
      this.#advance();
      const drawing = performance.now();
      if (stage?.draw()) this.stages.draw.tick(performance.now() - drawing);
    };
    requestAnimationFrame(frame);
  }

  #advance(): void {
    if (!this.#waiting) return;
    const start = performance.now();
    this.#last = this.#waiting;
    this.#waiting = undefined;
    this.stage?.take({ ...this.#last, guidance: this.#show(this.#last) });
    this.stages.take.tick(performance.now() - start);
    this.#stream.next();
  }

  /** Shows the numbers, as old as they are now, and gives them. */
  #show({ guidance, at }: Snapshot): Guidance {
    const now = aged(guidance, performance.now() - at);
    this.glasses?.take(now);
    this.panel.show(now);
    this.#shift.show(now);
    return now;
  }

  /** Takes what the server says of itself. */
  tell(status: Status): void {
    this.panel.tell(status);
    this.glasses?.tell(status);
  }

  /** Nothing that was shown can be trusted. */
  #gone(error: unknown): void {
    this.#last = this.#waiting = undefined;
    this.panel.gone();
    this.#shift.gone();
    this.stage?.see();
    this.glasses?.take(null);
    if (error instanceof Unauthorized) location.reload();
  }
}

async function main(): Promise<void> {
  const { api, first: opened } = await signIn((a) => a.case());
  const status = await api.status();
  describe(opened, status);
  offerReport(opened, api);
  offerInvitations(api, status.role);
  const images = opened.has_ct ? await api.container("/api/ct") : null;
  const stage = openStage(await api.container("/api/scene"), images, new URLSearchParams(location.search).has("vertices"));
  if (stage) controls(stage);
  new Calibrate(api);
  if (stage) new Register(api, stage);
  const view = new View(api, stage, new Shift(api, await api.tissue(), status.role === "operator"));
  const budget = new Budget();
  const told = (s: Status): void => {
    budget.show(s, view.stages);
    view.tell(s);
  };
  // A question that fails is asked again; that the server is gone is said by the stream.
  setInterval(() => api.status().then(told, () => undefined), BUDGET_MS);
  // For the console, and for tests that compare what is drawn with the API.
  Object.assign(window, { monro: { stage, glasses: view.glasses, panel: view.panel } });
}

// Without what it begins with there is nothing to show, and no numbers to trust.
main().catch((error: unknown) => {
  const said = make("p", { className: "said bad", textContent: `✗ This page could not be loaded: ${String(error)}. ` });
  said.append(make("button", { textContent: "Load it again", onclick: () => location.reload() }));
  document.body.prepend(said);
});
