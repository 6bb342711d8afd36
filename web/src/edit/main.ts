// The editor of labels. Rules live in the server; here are mouse, keys and drawing.

import type { Api } from "../api";
import { element } from "../dom";
import { signIn } from "../sign_in";
import { Desk, type Answer, type Description, type State, type Target } from "./desk";
import { Keys, type Binding } from "./keys";
import { Pane, type Hand, type Look } from "./pane";
import { buildPanel, words } from "./panel";
import { exportLabels, Rebuilder } from "./rebuild";
import { Options, request, TOOLS, type ToolName } from "./tools";

/** The label to begin with: where most drains go in. */
const FIRST = "right_lateral_ventricle";

class Editor {
  readonly #desk: Desk;
  readonly #about: Description;
  readonly #look: Look;
  readonly #panes: Pane[];
  readonly #options: Options;
  readonly #rebuilder: Rebuilder;
  /** Labels that are filled, whichever is chosen. */
  readonly #ventricles: number[];
  #tool: ToolName = "wire";
  #label: number;
  #current: Pane;
  #painting: { last: [number, number]; erase: boolean } | undefined;
  #moving: number | undefined;
  #hovering = false;
  /** Number of the preview that this page was shown last. */
  #shown: number | undefined;
  #hoverNext: Hand | undefined;
  #before = 0.45;
  #busy: Promise<unknown> = Promise.resolve();

  constructor(api: Api, about: Description) {
    this.#about = about;
    this.#ventricles = about.labels.filter((l) => l.ventricle).map((l) => l.label);
    this.#label = about.labels.find((l) => l.name === FIRST)?.label ?? 1;
    this.#rebuilder = new Rebuilder(api, (text) => this.#say(text));
    this.#desk = new Desk(api, (connected) => {
      element("#saved").textContent = connected ? "every step is saved" : "no connection to the server; if it was started again, open the address that it printed";
      if (connected) void this.#connected();
    }, (told) => void this.#edited(told));
    this.#look = { low: 0, high: 80, opacity: 0.3, colours: about.labels.map((l) => l.colour), filled: new Set(this.#ventricles) };
    this.#panes = about.views.map((v) => new Pane(v, this.#desk, this.#look, (kind, hand) => this.#mouse(kind, hand), (p) => this.#scrolled(p)));
    this.#current = this.#panes[0] as Pane;
    // Keys go to the pane that has the focus, also when Tab brought it there.
    for (const p of this.#panes) p.element.addEventListener("focus", () => p !== this.#current && this.#scrolled(p));
    const names = about.labels.slice(1).map((l): [string, string] => [String(l.label), words(l.name)]);
    this.#options = new Options(element("#options"), names, (id) => void this.#option(id));
    const [choose, pick] = [(tool: ToolName): void => this.#choose(tool), (label: number): void => this.#pick(label)];
    buildPanel(about, { choose, pick, window: (low, high) => this.#window(low, high), opacity: (value) => this.#opacity(value) });
    const [undo, redo] = [(): void => void this.#edit("undo"), (): void => void this.#edit("redo")];
    const keys = new Keys(this.#bindings, { choose, pick, undo, redo }, about.labels.length);
    [element("#undo").onclick, element("#redo").onclick, element("#help").onclick] = [undo, redo, () => keys.help()];
    element("#export").onclick = () => void exportLabels(api).catch((error: unknown) => this.#say(String(error)));
    this.#choose("wire");
    this.#pick(this.#label);
  }

  async start(): Promise<void> {
    await this.#desk.connect();
    this.#take({ id: 0, state: this.#about.state, wire: this.#about.wire });
    this.#scrolled(this.#current);
    await Promise.all(this.#panes.map((p) => p.load()));
    document.body.dataset["ready"] = "yes";
    // The page may have been loaded again meanwhile.
    await this.#rebuilder.resume();
  }

  #choose(name: ToolName): void {
    this.#tool = name;
    const tool = TOOLS.find((t) => t.name === name);
    if (tool) this.#options.show(tool);
    for (const b of document.querySelectorAll<HTMLElement>("[data-tool]")) b.setAttribute("aria-pressed", String(b.dataset["tool"] === name));
    for (const p of this.#panes) [p.path, p.snapped, p.brush] = [[], null, null];
    this.#redraw();
  }

  #pick(label: number): void {
    this.#label = label;
    this.#look.filled = new Set([...this.#ventricles, label]);
    this.#panes.forEach((p) => p.paint());
    for (const b of document.querySelectorAll<HTMLElement>("[data-label]")) b.setAttribute("aria-pressed", String(b.dataset["label"] === String(label)));
  }

  #window(low: number, high: number): void {
    [this.#look.low, this.#look.high] = [low, high];
    this.#panes.forEach((p) => p.paint());
    void this.#sendOptions();
  }

  #opacity(value: number): void {
    this.#look.opacity = value;
    element<HTMLInputElement>("#opacity").value = String(value);
    this.#panes.forEach((p) => p.paint());
  }

  #range(): [number, number] {
    // Values of a scan have 16 bits.
    const value = (id: string): number => Math.min(32767, Math.max(-32768, Math.round(Number(element<HTMLInputElement>(id).value))));
    return [value("#low"), value("#high")];
  }

  #target(): Target {
    const over = element<HTMLSelectElement>("#over").value;
    const masked = element<HTMLInputElement>("#masked").checked;
    return { label: this.#label, over: over === "any" ? null : over.split(",").map(Number), range: masked ? this.#range() : null };
  }

  /** How the wire goes: as it was set, whichever tool is chosen. */
  #sendOptions(): Promise<Answer> {
    const { low, high } = this.#look;
    const [snap_radius, cooling, training] = [this.#options.number("snap"), this.#options.checked("cooling"), this.#options.checked("training")];
    return this.#desk.ask("wire_options", { window: [low, high], snap_radius, cooling, training });
  }

  /** After a lost connection: whatever happened to the last step, the page shows what the server has. */
  async #connected(): Promise<void> {
    await this.#sendOptions();
    if (document.body.dataset["ready"]) await this.#edit("state");
  }

  /** Another page has edited or drawn on: this one shows the same. */
  async #edited(told: Answer): Promise<void> {
    // What the mouse showed went out from a wire that may be another now.
    for (const p of this.#panes) [p.path, p.closes] = [[], false];
    this.#show(told);
    await Promise.all(this.#panes.map((p) => p.load())).catch((error: unknown) => this.#say(String(error)));
  }

  #say(text: string): void {
    element("#message").textContent = text;
  }

  #redraw(): void {
    this.#panes.forEach((p) => p.draw());
  }

  #scrolled(pane: Pane): void {
    this.#current = pane;
    this.#hoverNext = undefined;
    [pane.path, pane.snapped] = [[], null];
    for (const p of this.#panes) {
      p.element.classList.toggle("current", p === pane);
      const inPlane = [0, 1, 2].filter((a) => a !== p.view.axis);
      p.cross = inPlane.map((a) => this.#panes.find((q) => q.view.axis === a)?.index ?? 0) as [number, number];
      p.draw();
    }
    void pane.load();
  }

  /** Shows what an answer brought, and why it was refused. */
  #take(answer: Answer): void {
    this.#say(answer.error ?? "");
    this.#show(answer);
  }

  #show(answer: Answer): void {
    if (answer.wire !== undefined) {
      for (const p of this.#panes) {
        p.wire = answer.wire;
        if (!answer.wire) p.path = [];
      }
    }
    if (answer.state) this.#state(answer.state);
    this.#redraw();
  }

  #state(state: State): void {
    for (const { label } of this.#about.labels.slice(1)) {
      element(`#ml-${label}`).textContent = `${(state.volumes_ml[label] ?? 0).toFixed(1)} ml`;
    }
    element<HTMLButtonElement>("#undo").disabled = state.past === 0;
    element<HTMLButtonElement>("#redo").disabled = state.future === 0;
    document.body.dataset["steps"] = String(state.past);
  }

  /** One edit after the other; all slices are shown again afterwards. */
  #edit(op: string, fields: object = {}): Promise<Answer> {
    const done = this.#busy.then(async () => {
      const answer = await this.#desk.ask(op, fields);
      this.#take(answer);
      await Promise.all(this.#panes.map((p) => p.load()));
      return answer;
    });
    // What was asked for was done or refused; only the pictures may be missing.
    this.#busy = done.catch((error: unknown) => this.#say(String(error)));
    return done;
  }

  #mouse(kind: "move" | "down" | "up" | "leave" | "double", hand: Hand): void {
    if (kind === "leave") {
      [hand.pane.snapped, hand.pane.brush] = [null, null];
      if (!hand.pane.wire) hand.pane.path = [];
      // Where the mouse is let go elsewhere, the anchor stays.
      this.#moving = undefined;
      this.#stopPainting();
      hand.pane.draw();
    } else if (this.#tool === "wire") this.#wire(kind, hand);
    else if (this.#tool === "brush" || this.#tool === "eraser") this.#brush(kind, hand);
    else if (this.#tool === "grow" && kind === "down") this.#grow(hand);
    else if (kind === "down") this.#scrollTo(hand);
  }

  #place(hand: Hand): { axis: number; slice: number; at: [number, number] } {
    return { axis: hand.pane.view.axis, slice: hand.pane.index, at: hand.at };
  }

  #wire(kind: "move" | "down" | "up" | "double", hand: Hand): void {
    if (kind === "move") {
      if (this.#moving !== undefined) return;
      this.#hoverNext = hand;
      void this.#hover();
    } else if (kind === "down" && hand.event.button === 2) {
      void this.#edit("undo");
    } else if (kind === "down" && hand.event.button === 0 && hand.event.detail < 2) {
      const anchors = hand.pane.wire?.slice === hand.pane.index && hand.pane.wire.axis === hand.pane.view.axis ? hand.pane.wire.anchors : [];
      const [x, y] = hand.pane.screenAt(hand.at);
      const grabbed = anchors.findIndex((a, i) => {
        const [u, v] = hand.pane.screenAt(a);
        // The first one closes, unless it is dragged with Shift.
        return Math.hypot(u - x, v - y) < 7 && (i > 0 || hand.event.shiftKey);
      });
      if (grabbed >= 0 && grabbed < anchors.length - 1) this.#moving = grabbed;
      else if (hand.pane.closes) void this.#close();
      else void this.#click(hand);
    } else if (kind === "up" && this.#moving !== undefined) {
      const anchor = this.#moving;
      this.#moving = undefined;
      void this.#desk.ask("move_anchor", { anchor, at: hand.at }).then((a) => this.#take(a));
    } else if (kind === "double") {
      void this.#close();
    }
  }

  async #click(hand: Hand): Promise<void> {
    this.#current = hand.pane;
    this.#take(await this.#desk.ask("click", this.#place(hand)));
    this.#hoverNext = hand;
    void this.#hover();
  }

  /** Closes the wire, where it is to be seen; elsewhere it is shown first. */
  #close(): Promise<Answer> {
    const hidden = this.#panes.find((p) => p.wire?.axis === p.view.axis && p.wire.slice !== p.index);
    if (hidden?.wire) {
      hidden.index = hidden.wire.slice;
      this.#scrolled(hidden);
      const error = `The open wire is on this slice, ${hidden.view.name} ${hidden.index + 1}: close it (Enter) or give it up (Escape).`;
      this.#say(error);
      return Promise.resolve({ id: 0, error });
    }
    for (const p of this.#panes) [p.path, p.closes, p.snapped] = [[], false, null];
    return this.#edit("close", { target: this.#target(), mode: this.#options.choice("mode"), interpolate: this.#options.checked("interpolate") });
  }

  /** The wire under the mouse: one question at a time, the newest place wins. */
  async #hover(): Promise<void> {
    if (this.#hovering) return;
    this.#hovering = true;
    while (this.#hoverNext) {
      const hand = this.#hoverNext;
      this.#hoverNext = undefined;
      const begun = performance.now();
      const asked = this.#place(hand);
      const answer = await this.#desk.ask("hover", { ...asked, time: begun / 1000 });
      document.body.dataset["hoverMs"] = (performance.now() - begun).toFixed(2);
      if (this.#tool !== "wire" || hand.pane.index !== asked.slice) continue;
      hand.pane.snapped = answer.snapped ?? null;
      hand.pane.path = answer.path ?? [];
      hand.pane.closes = answer.closes ?? false;
      if (answer.error) this.#say(answer.error);
      this.#show(answer);
      hand.pane.draw();
    }
    this.#hovering = false;
  }

  #brush(kind: "move" | "down" | "up" | "double", hand: Hand): void {
    hand.pane.brush = { at: hand.at, radius: this.#options.number("radius") };
    if (kind === "down" && hand.event.button !== 1) {
      this.#painting = { last: hand.at, erase: this.#tool === "eraser" || hand.event.button === 2 };
      this.#dab(hand, [hand.at]);
    } else if (kind === "move" && this.#painting) {
      this.#dab(hand, [this.#painting.last, hand.at]);
      this.#painting.last = hand.at;
    } else if (kind === "up") {
      this.#stopPainting();
    }
    hand.pane.draw();
  }

  #dab(hand: Hand, points: [number, number][]): void {
    const erase = this.#painting?.erase ?? false;
    const { axis, slice } = this.#place(hand);
    const fields = { target: this.#target(), axis, slice, points, radius_mm: this.#options.number("radius"), flat: !this.#options.checked("ball"), erase };
    this.#busy = this.#busy.then(async () => {
      const answer = await this.#desk.ask("brush", fields);
      if (answer.error) this.#take(answer);
      if (answer.changed) await hand.pane.load();
    }).catch((error: unknown) => this.#say(String(error)));
  }

  #stopPainting(): void {
    if (!this.#painting) return;
    this.#painting = undefined;
    void this.#edit("end_stroke", { interpolate: this.#options.checked("interpolate") });
  }

  /** The voxel under the mouse. */
  #voxel(hand: Hand): [number, number, number] {
    const voxel: [number, number, number] = [0, 0, 0];
    const [c, r] = [0, 1, 2].filter((a) => a !== hand.pane.view.axis) as [0 | 1 | 2, 0 | 1 | 2];
    voxel[hand.pane.view.axis] = hand.pane.index;
    voxel[c] = Math.round(hand.at[0]);
    voxel[r] = Math.round(hand.at[1]);
    return voxel;
  }

  #grow(hand: Hand): void {
    const seed = this.#voxel(hand);
    if (seed.some((v, a) => v < 0 || v >= (this.#about.dims[a] ?? 0))) {
      this.#say("Click a seed within the image.");
      return;
    }
    const tool = { name: "grow", seed, range: this.#range(), neck_mm: this.#options.number("neck"), most_ml: this.#options.number("most") };
    void this.#preview(tool);
  }

  /** The other slices go through the clicked place. */
  #scrollTo(hand: Hand): void {
    const voxel = this.#voxel(hand);
    for (const p of this.#panes.filter((q) => q !== hand.pane)) {
      p.index = Math.min(p.view.slices - 1, Math.max(0, voxel[p.view.axis] ?? 0));
      void p.load();
    }
    this.#scrolled(hand.pane);
  }

  async #preview(tool: object): Promise<void> {
    const answer = await this.#edit("preview", { tool, target: this.#target() });
    if (!answer.preview) return;
    const { ml, stopped } = answer.preview;
    this.#shown = answer.preview.number;
    this.#say(stopped
      ? `Stopped at ${ml.toFixed(1)} ml: this is a leak. Narrow the values or widen the neck.`
      : `${ml.toFixed(2)} ml; Apply (Enter) takes it, Escape drops it.`);
  }

  async #option(id: string): Promise<void> {
    if (id === "preview") {
      const tool = request(this.#tool, this.#options, this.#range(), this.#current.view.axis);
      if (tool) await this.#preview(tool);
    } else if (id === "apply") {
      await this.#apply();
    } else if (id === "fill-between") {
      const filled = await this.#edit("interpolate", { axis: this.#current.view.axis, target: this.#target() });
      // From now on a correction on any slice goes on to its neighbours; the box says so and takes it back.
      if (!filled.error) this.#options.check("interpolate");
    } else if (this.#tool === "wire") {
      await this.#sendOptions();
    }
  }

  async #apply(): Promise<void> {
    const answer = await this.#edit("apply", { target: this.#target(), preview: this.#shown });
    if (!answer.error) this.#say(`${answer.changed ?? 0} voxels changed`);
  }

  readonly #bindings: Binding[] = [
    ["Enter", "close the wire, or apply the preview", () => void (this.#tool === "wire" ? this.#close() : this.#apply())],
    ["Escape", "give the wire or the preview up", () => void this.#edit("drop_wire").then(() => this.#edit("discard"))],
    ["Backspace", "take the last click back", () => void this.#edit("undo")],
    ["[", "smaller brush", () => this.#options.scale("radius", 1 / 1.25)],
    ["]", "larger brush", () => this.#options.scale("radius", 1.25)],
    ["+", "zoom in", () => this.#current.zoom(1.2)],
    ["-", "zoom out", () => this.#current.zoom(1 / 1.2)],
    ["l", "show and hide the labels", () => this.#toggle()],
    ["f", "fill between drawn slices", () => void this.#option("fill-between")],
  ];

  #toggle(): void {
    const now = this.#look.opacity;
    if (now > 0) this.#before = now;
    this.#opacity(now > 0 ? 0 : this.#before);
  }
}

void signIn((api) => api.json<Description>("/api/desk")).then(({ api, first }) => new Editor(api, first).start());
