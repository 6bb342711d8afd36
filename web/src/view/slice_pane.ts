// A slice in its pane: title, letters, position, and what pointer and keys do there.

import { Vector3 } from "three";
import { listen } from "./gestures";
import type { Plane } from "./plane";
import type { Slice } from "./slice";

const SIDES = ["left", "right", "top", "bottom"] as const;
/** mm a slice moves by one click of the wheel or one key. */
const STEP_MM = 1;

export interface SliceActions {
  /** The user takes the crosshair somewhere. */
  cross(p: Vector3): void;
  /** Where it is. */
  crossed(): Vector3;
  /** Something is to be drawn anew. */
  changed(): void;
}

export class SlicePane {
  readonly pane: HTMLElement;
  readonly slice: Slice;
  /** Whether the plane is held by the catheter. */
  readonly oblique: boolean;
  readonly #title = document.createElement("h2");
  readonly #label = document.createElement("output");
  readonly #marks: HTMLElement[];

  constructor(pane: HTMLElement, title: string, slice: Slice, oblique: boolean, actions: SliceActions) {
    [this.pane, this.slice, this.oblique] = [pane, slice, oblique];
    this.#title.textContent = title;
    this.#marks = SIDES.map((side) => {
      const mark = document.createElement("span");
      mark.className = `mark ${side}`;
      return mark;
    });
    pane.append(this.#title, ...this.#marks, this.#label);
    this.#listen(actions);
    this.label();
  }

  #listen(actions: SliceActions): void {
    const { pane, slice } = this;
    const zoom = (factor: number): void => {
      slice.zoom(factor, actions.crossed());
      actions.changed();
    };
    const move = (steps: number): void => actions.cross(actions.crossed().addScaledVector(slice.plane.normal, steps * STEP_MM));
    const pick = (x: number, y: number): void => actions.cross(slice.pick(x, y, pane.offsetWidth, pane.offsetHeight));
    listen(pane, { pick, zoom, scroll: move });
    pane.addEventListener("wheel", (e) => {
      e.preventDefault();
      if (e.ctrlKey) zoom(Math.exp(e.deltaY / 300));
      else move(Math.sign(e.deltaY));
    }, { passive: false });
    const keys: Record<string, () => void> = {
      PageUp: () => move(-1), PageDown: () => move(1), "+": () => zoom(0.9), "-": () => zoom(1 / 0.9),
      ArrowLeft: () => nudge(actions, slice.plane.right, -1), ArrowRight: () => nudge(actions, slice.plane.right, 1),
      ArrowUp: () => nudge(actions, slice.plane.up, 1), ArrowDown: () => nudge(actions, slice.plane.up, -1),
    };
    pane.addEventListener("keydown", (e) => {
      const act = keys[e.key];
      if (!act) return;
      act();
      e.preventDefault();
    });
  }

  /** Writes where the plane is. */
  label(): void {
    const { plane } = this.slice;
    plane.letters().forEach((letter, i) => {
      const mark = this.#marks[i];
      if (mark && mark.textContent !== letter) mark.textContent = letter;
    });
    const text = this.oblique ? "" : position(plane);
    if (this.#label.value !== text) this.#label.value = text;
  }
}

function nudge(actions: SliceActions, along: Vector3, steps: number): void {
  actions.cross(actions.crossed().addScaledVector(along, steps * STEP_MM));
}

/** "S 12.3 mm": how far from the scanner's origin, and which way. */
function position({ normal, offset }: Plane): string {
  const along = offset * Math.sign(normal.x + normal.y + normal.z);
  const [there, back] = normal.x ? "LR" : normal.y ? "PA" : "SI";
  return `${along < 0 ? back : there} ${Math.abs(along).toFixed(1)} mm`;
}
