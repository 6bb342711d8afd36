// The target's-eye view: along the catheter, which is the cross in the middle. Steer until the target is there.

import { OrthographicCamera, Vector3, type WebGLRenderer } from "three";
import type { Seen } from "../api";
import { write } from "../dom";
import type { World } from "./world";

const SVG = "http://www.w3.org/2000/svg";
/** From the middle to the nearer edge, mm: the smallest of these in which the target is seen. */
const RANGES_MM = [15, 30, 60, 120];
/** The range is left for a smaller one only when the target is well inside of that, so that it does not flicker. */
const INSIDE = 0.75;
const DEPTH_MM = 200;

function svg<K extends keyof SVGElementTagNameMap>(parent: Element, tag: K, attributes: Record<string, string | number>): SVGElementTagNameMap[K] {
  const made = document.createElementNS(SVG, tag);
  set(made, attributes);
  parent.append(made);
  return made;
}

function set(to: Element, attributes: Record<string, string | number>): void {
  for (const [name, value] of Object.entries(attributes)) to.setAttribute(name, String(value));
}

export class Eye {
  readonly #world: World;
  readonly #camera = new OrthographicCamera();
  readonly #ringText: SVGTextElement;
  readonly #target: SVGGElement;
  readonly #error: SVGCircleElement;
  readonly #line: SVGLineElement;
  readonly #output = document.createElement("output");
  #range = RANGES_MM[1]!;
  #up = new Vector3(0, -1, 0);

  constructor(pane: HTMLElement, world: World) {
    this.#world = world;
    const root = svg(pane, "svg", { viewBox: "-100 -100 200 200", "aria-hidden": "true" });
    for (const part of [1 / 3, 2 / 3, 1]) svg(root, "circle", { class: "ring", r: 96 * part });
    this.#ringText = svg(root, "text", { class: "ring-text", x: 0, y: 93, "text-anchor": "middle" });
    svg(root, "path", { class: "cross", d: "M-14 0H-4M4 0H14M0-14V-4M0 4V14" });
    this.#line = svg(root, "line", { class: "steer" });
    this.#target = svg(root, "g", {});
    this.#error = svg(this.#target, "circle", { class: "error" });
    svg(this.#target, "circle", { class: "target", r: 5 });
    svg(this.#target, "circle", { class: "dot", r: 1.5 });
    pane.append(this.#output);
  }

  /** px of the drawing for a mm. */
  get #scale(): number {
    return 96 / this.#range;
  }

  take(guidance: Seen): void {
    const { target_in_eye_mm: at, predicted_tre_mm: tre, eye_up_lps: up } = guidance;
    if (up) this.#up.set(...up);
    this.#target.style.display = this.#line.style.display = at ? "" : "none";
    if (!at) {
      write(this.#output, "");
      return;
    }
    this.#choose(Math.hypot(...at) + (tre ?? 0));
    const [x, y] = [at[0] * this.#scale, -at[1] * this.#scale];
    set(this.#target, { transform: `translate(${x.toFixed(2)} ${y.toFixed(2)})` });
    set(this.#line, { x2: x.toFixed(2), y2: y.toFixed(2) });
    set(this.#error, { r: ((tre ?? 0) * this.#scale).toFixed(2) });
    write(this.#output, tre === null ? "error unknown" : `error circle ${tre.toFixed(1)} mm`);
  }

  #choose(needed: number): void {
    const fits = (range: number): boolean => needed <= (range < this.#range ? INSIDE * range : range);
    this.#range = RANGES_MM.find(fits) ?? RANGES_MM.at(-1)!;
    write(this.#ringText, `${this.#range} mm`);
  }

  draw(renderer: WebGLRenderer, aspect: number): void {
    const { tip, axis, seen } = this.#world.needle;
    if (!seen) return;
    const half = (this.#range * 100) / 96;
    const [x, y] = aspect > 1 ? [half * aspect, half] : [half, half / aspect];
    Object.assign(this.#camera, { left: -x, right: x, top: y, bottom: -y, near: 0, far: DEPTH_MM });
    this.#camera.position.copy(tip);
    this.#camera.up.copy(this.#up);
    this.#camera.lookAt(tip.clone().add(axis));
    this.#camera.updateProjectionMatrix();
    this.#world.drawInside(renderer, this.#camera);
  }
}
