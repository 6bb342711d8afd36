// Fingers and mouse on a slice: one picks, two pinch and scroll. A finger picks only when it moves or is lifted, for it may
// be the first of two.

export interface Gestures {
  /** A place of the pane, CSS px from its upper left corner. */
  pick(x: number, y: number): void;
  /** What is seen becomes so many times as large. */
  zoom(factor: number): void;
  scroll(steps: number): void;
}

/** Px that two fingers move for a step of the slice. */
const STEP_PX = 8;

interface Finger {
  x: number;
  y: number;
}

const apart = ([a, b]: Finger[]): number => (a && b ? Math.hypot(a.x - b.x, a.y - b.y) : 0);
const height = (fingers: Finger[]): number => fingers.reduce((sum, f) => sum + f.y, 0) / fingers.length;

export function listen(pane: HTMLElement, gestures: Gestures): void {
  const fingers = new Map<number, Finger>();
  // Whether there were two of late, and how far they have moved since the last step.
  let [several, rest] = [false, 0];
  const place = (e: PointerEvent): Finger => {
    const box = pane.getBoundingClientRect();
    return { x: e.clientX - box.left, y: e.clientY - box.top };
  };
  const pick = (e: PointerEvent): void => gestures.pick(place(e).x, place(e).y);
  const pinch = (before: Finger[], after: Finger[]): void => {
    if (apart(before) > 0 && apart(after) > 0) gestures.zoom(apart(before) / apart(after));
    rest += (height(after) - height(before)) / STEP_PX;
    const steps = Math.trunc(rest);
    rest -= steps;
    if (steps) gestures.scroll(steps);
  };
  const move = (e: PointerEvent): void => {
    if (!fingers.has(e.pointerId)) return;
    const before = [...fingers.values()];
    fingers.set(e.pointerId, place(e));
    if (fingers.size === 2) pinch(before, [...fingers.values()]);
    else if (!several) pick(e);
  };
  const lift = (e: PointerEvent): void => {
    if (!fingers.delete(e.pointerId)) return;
    if (!several && e.pointerType === "touch" && e.type === "pointerup") pick(e);
    if (fingers.size === 0) several = false;
  };
  pane.addEventListener("pointerdown", (e) => {
    if (e.button !== 0) return;
    pane.setPointerCapture(e.pointerId);
    fingers.set(e.pointerId, place(e));
    if (fingers.size > 1) [several, rest] = [true, 0];
    else if (e.pointerType !== "touch") pick(e);
  });
  pane.addEventListener("pointermove", move);
  pane.addEventListener("pointerup", lift);
  pane.addEventListener("pointercancel", lift);
}
