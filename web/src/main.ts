// Opens the session and keeps panel and stage up to date.

import { Unauthorized, type Api, type Case, type Status } from "./api";
import { Budget, Counter, type Stages } from "./budget";
import { Calibrate } from "./calibrate";
import { controls } from "./controls";
import { element } from "./dom";
import { Panel } from "./panel";
import { Register } from "./register";
import { signIn } from "./sign_in";
import { aged, type Snapshot } from "./snapshot";
import { Stream } from "./stream";
import { Stage } from "./view/stage";
import { Glasses } from "./xr/glasses";

/** How often rates are shown, ms. */
const BUDGET_MS = 1000;

function describe(opened: Case, status: Status): void {
  element("#patient").textContent = opened.pseudonym;
  element("#side").textContent = `${opened.side.toUpperCase()} SIDE`;
  element("#tracker").textContent = status.simulated ? "Simulated tracker, exact registration" : status.tracker;
  document.title = `${opened.pseudonym} · Monro`;
}

/** The report opens in a tab of its own: a ticket lets it in, for links carry no token. */
function offerReport(opened: Case, api: Api): void {
  const button = element<HTMLButtonElement>("#report");
  button.hidden = !opened.has_report;
  button.onclick = () => void api.ticket().then((ticket) => window.open(`/report?ticket=${ticket}`, "_blank", "noopener"));
}

async function main(): Promise<void> {
  const panel = new Panel();
  const { api, first: opened } = await signIn((a) => a.case());
  describe(opened, await api.status());
  offerReport(opened, api);
  const images = opened.has_ct ? await api.container("/api/ct") : null;
  const stage = new Stage(await api.container("/api/scene"), images, new URLSearchParams(location.search).has("vertices"));
  controls(stage);
  new Calibrate(api);
  new Register(api, stage);
  const stages: Stages = { take: new Counter(), draw: new Counter() };
  const budget = new Budget();
  let waiting: Snapshot | undefined;
  const advance = (): void => {
    if (!waiting) return;
    const start = performance.now();
    stage.take(waiting);
    const guidance = aged(waiting.guidance, performance.now() - waiting.at);
    glasses.take(guidance);
    panel.show(guidance);
    waiting = undefined;
    stages.take.tick(performance.now() - start);
    stream.next();
  };
  const glasses = new Glasses(stage, advance);
  const stream = new Stream(api, stage.whole, (s) => (waiting = s), (error) => {
    panel.gone();
    stage.see();
    glasses.take(null);
    if (error instanceof Unauthorized) location.reload();
  });
  const frame = (): void => {
    requestAnimationFrame(frame);
    // They have frames of their own.
    if (glasses.presenting) return;
    advance();
    const drawing = performance.now();
    if (stage.draw()) stages.draw.tick(performance.now() - drawing);
  };
  requestAnimationFrame(frame);
  // A question that fails is asked again; that the server is gone is said by the stream.
  setInterval(() => api.status().then((s) => budget.show(s, stages), () => undefined), BUDGET_MS);
  // For the console, and for tests that compare what is drawn with the API.
  Object.assign(window, { monro: { stage, glasses, panel } });
}

void main();
