// From a scan to a case: choose, watch, look, move the path, open. What is right is decided by the server.

import { NotFound, Refused, type Api, type Point } from "../api";
import { ctControls, layers, windows } from "../controls";
import { element, make, write } from "../dom";
import { signIn } from "../sign_in";
import { Stage } from "../view/stage";

interface Made {
  version: number;
  pseudonym: string;
  side: string;
  findings: string[];
  plan: { entry_lps_mm: Point; target_lps_mm: Point; length_mm: number; skull_angle_deg: number | null };
  volumes_ml: [string, number][];
  elements: number;
}

interface State {
  scans: string[];
  running: boolean;
  stage: string | null;
  stage_seconds: number | null;
  done: { stage: string; seconds: number }[];
  remarks: string[];
  error: string | null;
  made: Made | null;
}

const STAGES = ["read", "segment", "surfaces", "plan", "tetrahedra", "views"];
/** How often progress is asked for, ms. */
const ASK_MS = 300;

class Preparing {
  readonly #api: Api;
  readonly #said = element("#said");
  readonly #opens = element<HTMLButtonElement>("#open");
  readonly #buttons: HTMLButtonElement[];
  #stage: Stage | null = null;
  #made: Made | null = null;
  #opening = false;
  /** Whether the last question had no answer. */
  #missing = false;

  constructor(api: Api) {
    this.#api = api;
    const scan = element<HTMLSelectElement>("#scan");
    const side = element<HTMLSelectElement>("#entry-side");
    element("#start").onclick = () => void this.#act({ action: "start", scan: scan.value, side: side.value });
    this.#opens.onclick = () => void this.#open();
    const path = (text: string, act: (made: Made, at: Point) => [Point, Point]): HTMLButtonElement => {
      const button = make("button", { textContent: text, disabled: true });
      button.onclick = () => this.#path(act);
      return button;
    };
    this.#buttons = [
      path("Target to the crosshair", ({ plan }, at) => [plan.entry_lps_mm, at]),
      path("Entry to the skin at the crosshair", ({ plan }, at) => [at, plan.target_lps_mm]),
    ];
    element("#path").append(...this.#buttons);
    void this.#watch();
  }

  #path(act: (made: Made, at: Point) => [Point, Point]): void {
    if (!this.#made || !this.#stage) return;
    const [entry_lps_mm, target_lps_mm] = act(this.#made, this.#stage.crosshair.toArray() as Point);
    void this.#act({ action: "path", entry_lps_mm, target_lps_mm });
  }

  async #act(action: object): Promise<void> {
    try {
      await this.#api.post("/api/prepare", action);
      this.#say("");
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.#say(error.message, true);
    }
  }

  async #open(): Promise<void> {
    this.#opening = this.#opens.disabled = true;
    this.#say("Writing the case and building the soft body …");
    try {
      await this.#api.post("/api/prepare", { action: "open" });
      // The same address is now the live session's.
      location.reload();
    } catch (error) {
      this.#opening = false;
      this.#say(error instanceof Error ? error.message : String(error), true);
    }
  }

  #say(text: string, bad = false): void {
    this.#said.classList.toggle("bad", bad);
    write(this.#said, text);
  }

  async #watch(): Promise<void> {
    // While it opens, the server changes from one half to the other.
    try {
      if (!this.#opening) await this.#show(await this.#api.json<State>("/api/prepare"));
      if (this.#missing) this.#say("");
      this.#missing = false;
    } catch (error) {
      // Another page has opened the case: the same address is now the live session's.
      if (error instanceof NotFound) return location.reload();
      this.#missing = true;
      this.#say(`No answer from the server: ${error instanceof Error ? error.message : String(error)}`, true);
    }
    setTimeout(() => void this.#watch(), ASK_MS);
  }

  async #show(state: State): Promise<void> {
    this.#list(state);
    this.#progress(state);
    element<HTMLButtonElement>("#start").disabled = state.running || !state.scans.length;
    for (const button of [...this.#buttons, this.#opens]) button.disabled = state.running || !state.made || this.#opening;
    if (state.error) this.#say(state.error, true);
    if (!state.made || state.made.version === this.#made?.version) return;
    // A page shows one case: another one begins it anew.
    if (this.#made) location.reload();
    this.#made = state.made;
    this.#facts(state.made);
    await this.#draw();
  }

  #list({ scans }: State): void {
    const select = element<HTMLSelectElement>("#scan");
    if ([...select.options].map((o) => o.value).join("\n") === scans.join("\n")) return;
    select.replaceChildren(...scans.map((name) => make("option", { textContent: name, value: name })));
  }

  #progress({ done, stage, stage_seconds, remarks, running }: State): void {
    const known = new Map(done.map((d) => [d.stage, d.seconds]));
    const item = (name: string): HTMLLIElement => {
      const seconds = known.get(name) ?? (stage === name ? stage_seconds : null);
      const kind = known.has(name) ? "done" : stage === name ? "running" : "waiting";
      return make("li", { className: kind }, make("span", { textContent: name }), make("span", { textContent: seconds === null ? "" : `${seconds.toFixed(1)} s` }));
    };
    // Another path begins with labels that are known.
    const begun = STAGES.indexOf(done[0]?.stage ?? stage ?? "read");
    element("#stages").replaceChildren(...(running || done.length ? STAGES.slice(Math.max(0, begun)).map(item) : []));
    const list = element("#remarks");
    if (list.children.length !== remarks.length) list.replaceChildren(...remarks.map((text) => make("li", { textContent: text })));
  }

  #facts(made: Made): void {
    write(element("#patient"), made.pseudonym);
    write(element("#side"), `${made.side.toUpperCase()} SIDE`);
    element<HTMLSelectElement>("#entry-side").value = made.side;
    const angle = made.plan.skull_angle_deg;
    const rows: [string, string][] = [
      ["Path", `${made.plan.length_mm.toFixed(1)} mm`], ["To the skull (90° is perpendicular)", angle === null ? "–" : `${angle.toFixed(0)}°`],
      ...made.volumes_ml.map(([name, ml]): [string, string] => [name.replaceAll("_", " "), `${ml.toFixed(1)} ml`]),
      ["Elements", String(made.elements)],
    ];
    element("#facts").replaceChildren(...rows.map(([term, value]) => make("div", {}, make("dt", { textContent: term }), make("dd", { textContent: value }))));
  }

  async #draw(): Promise<void> {
    const [scene, images] = [await this.#api.container("/api/scene"), await this.#api.container("/api/ct")];
    const stage = (this.#stage = new Stage(scene, images, false));
    layers(stage);
    ctControls(stage, ["outlines"]);
    windows(stage);
    const frame = (): void => {
      stage.draw();
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    Object.assign(window, { monro: { stage } });
  }
}

void signIn((api) => api.json("/api/prepare")).then(({ api }) => new Preparing(api));
