// One slice direction: image, labels, wire and brush on a canvas, and the mouse on it.

import type { Desk, Point, View, Wire } from "./desk";

export interface Look {
  low: number;
  high: number;
  opacity: number;
  colours: [number, number, number][];
  /** Labels that are filled; the others are outlines, so that the image stays visible. */
  filled: Set<number>;
}

/** What the mouse did, at a continuous pixel index of the slice. */
export interface Hand {
  pane: Pane;
  at: Point;
  event: MouseEvent;
}

type Listener = (kind: "move" | "down" | "up" | "leave" | "double", hand: Hand) => void;

const NAMES = { axial: ["R", "L", "A", "P"], coronal: ["R", "L", "S", "I"], sagittal: ["A", "P", "S", "I"] } as const;

export class Pane {
  readonly view: View;
  readonly element: HTMLElement;
  index: number;
  readonly #desk: Desk;
  readonly #look: Look;
  readonly #canvas = document.createElement("canvas");
  readonly #image = document.createElement("canvas");
  readonly #title = document.createElement("output");
  readonly #kept = new Map<number, Int16Array>();
  #hu: Int16Array | undefined;
  #labels: Uint8Array | undefined;
  #asked = 0;
  #zoom = 1;
  #shift: Point = [0, 0];
  #drag: { from: Point; shift: Point } | undefined;
  wire: Wire | null = null;
  path: Point[] = [];
  snapped: Point | null = null;
  closes = false;
  /** Brush under the mouse: place and radius in mm. */
  brush: { at: Point; radius: number } | null = null;
  /** Places of the other two slices, as indices of the columns and rows of this one. */
  cross: Point | null = null;

  constructor(view: View, desk: Desk, look: Look, listener: Listener, scrolled: (pane: Pane) => void) {
    this.view = view;
    this.index = Math.floor(view.slices / 2);
    this.#desk = desk;
    this.#look = look;
    const element = document.querySelector<HTMLElement>(`#${view.name}`);
    if (!element) throw new Error(`The page has no #${view.name}.`);
    this.element = element;
    [this.#image.width, this.#image.height] = view.size;
    element.append(this.#canvas, this.#title);
    NAMES[view.name].forEach((name, i) => {
      const mark = document.createElement("span");
      mark.className = `mark ${["left", "right", "top", "bottom"][i]}`;
      mark.textContent = name;
      element.append(mark);
    });
    this.#listen(listener, scrolled);
    new ResizeObserver(() => this.draw()).observe(element);
  }

  #listen(listener: Listener, scrolled: (pane: Pane) => void): void {
    const e = this.element;
    const hand = (event: MouseEvent): Hand => ({ pane: this, at: this.indexAt([event.offsetX, event.offsetY]), event });
    e.addEventListener("mousemove", (event) => {
      if (this.#drag) {
        this.#shift = [
          this.#drag.shift[0] + event.offsetX - this.#drag.from[0],
          this.#drag.shift[1] + event.offsetY - this.#drag.from[1],
        ];
        this.draw();
      } else {
        listener("move", hand(event));
      }
    });
    e.addEventListener("mousedown", (event) => {
      e.focus();
      if (event.button === 1 || (event.button === 0 && event.altKey)) {
        event.preventDefault();
        this.#drag = { from: [event.offsetX, event.offsetY], shift: this.#shift };
      } else {
        listener("down", hand(event));
      }
    });
    e.addEventListener("mouseup", (event) => {
      if (this.#drag) this.#drag = undefined;
      else listener("up", hand(event));
    });
    e.addEventListener("mouseleave", (event) => {
      this.#drag = undefined;
      listener("leave", hand(event));
    });
    e.addEventListener("dblclick", (event) => listener("double", hand(event)));
    e.addEventListener("contextmenu", (event) => event.preventDefault());
    e.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (event.ctrlKey) this.#zoomAt([event.offsetX, event.offsetY], event.deltaY < 0 ? 1.2 : 1 / 1.2);
      else this.step(event.deltaY < 0 ? 1 : -1, scrolled);
    }, { passive: false });
    e.addEventListener("keydown", (event) => {
      if (event.key === "PageUp" || event.key === "ArrowUp") this.step(1, scrolled);
      else if (event.key === "PageDown" || event.key === "ArrowDown") this.step(-1, scrolled);
      else return;
      event.preventDefault();
    });
  }

  /** Up, left or back by a slice. */
  step(by: number, scrolled: (pane: Pane) => void): void {
    this.index = Math.min(this.view.slices - 1, Math.max(0, this.index + (this.view.ascending ? by : -by)));
    scrolled(this);
  }

  #zoomAt(at: Point, by: number): void {
    const before = this.indexAt(at);
    this.#zoom = Math.min(20, Math.max(0.5, this.#zoom * by));
    const after = this.screenAt(before);
    this.#shift = [this.#shift[0] + at[0] - after[0], this.#shift[1] + at[1] - after[1]];
    this.draw();
  }

  zoom(by: number): void {
    this.#zoomAt([this.element.clientWidth / 2, this.element.clientHeight / 2], by);
  }

  /** Screen from pixel index: [a c e; b d f] as in a canvas transform, in CSS pixels. */
  matrix(): [number, number, number, number, number, number] {
    const { size, spacing_mm: mm, transpose, flip } = this.view;
    const [w, h] = [this.element.clientWidth, this.element.clientHeight];
    const wide = transpose ? [size[1] * mm[1], size[0] * mm[0]] as const : [size[0] * mm[0], size[1] * mm[1]] as const;
    const scale = this.#zoom * Math.min(w / wide[0], h / wide[1]);
    const sx = scale * (flip[0] ? -1 : 1);
    const sy = scale * (flip[1] ? -1 : 1);
    const [mx, my] = [(size[0] - 1) / 2, (size[1] - 1) / 2];
    // Columns and rows as screen directions.
    const [a, b, c, d] = transpose ? [0, sy * mm[0], sx * mm[1], 0] : [sx * mm[0], 0, 0, sy * mm[1]];
    const e = w / 2 + this.#shift[0] - a * mx - c * my;
    const f = h / 2 + this.#shift[1] - b * mx - d * my;
    return [a, b, c, d, e, f];
  }

  screenAt([x, y]: Point): Point {
    const [a, b, c, d, e, f] = this.matrix();
    return [a * x + c * y + e, b * x + d * y + f];
  }

  indexAt([x, y]: Point): Point {
    const [a, b, c, d, e, f] = this.matrix();
    const det = a * d - b * c;
    const [u, v] = [x - e, y - f];
    return [(d * u - c * v) / det, (a * v - b * u) / det];
  }

  /** Fetches what is shown; the newest question wins. */
  async load(): Promise<void> {
    const [asked, index] = [++this.#asked, this.index];
    const known = this.#kept.get(index);
    const [hu, labels] = await Promise.all([known ?? this.#desk.hu(this.view.axis, index), this.#desk.labels(this.view.axis, index)]);
    this.#kept.set(index, hu);
    if (this.#kept.size > 64) this.#kept.delete(this.#kept.keys().next().value ?? -1);
    if (asked !== this.#asked) return;
    [this.#hu, this.#labels] = [hu, labels];
    this.paint();
  }

  /** The image from values and labels. */
  paint(): void {
    const context = this.#image.getContext("2d");
    if (!context || !this.#hu || !this.#labels) return;
    const { low, high, opacity, colours, filled } = this.#look;
    const out = context.createImageData(this.#image.width, this.#image.height);
    const scale = 255 / Math.max(1, high - low);
    const w = this.#image.width;
    for (let n = 0; n < this.#hu.length; n++) {
      const grey = Math.min(255, Math.max(0, ((this.#hu[n] ?? 0) - low) * scale));
      const code = this.#labels[n] ?? 0;
      const label = code & 127;
      let mix = filled.has(label) ? opacity : 0;
      let colour = colours[label] ?? [0, 0, 0];
      // Outlines stay when the filling is faint.
      if (label && (this.#labels[n - 1] !== code || this.#labels[n + 1] !== code || this.#labels[n - w] !== code || this.#labels[n + w] !== code)) {
        mix = opacity > 0 ? Math.max(mix, 0.75) : 0;
      }
      if (code & 128) [mix, colour] = [0.6, [255, 255, 255]];
      out.data[4 * n] = grey + mix * (colour[0] - grey);
      out.data[4 * n + 1] = grey + mix * (colour[1] - grey);
      out.data[4 * n + 2] = grey + mix * (colour[2] - grey);
      out.data[4 * n + 3] = 255;
    }
    context.putImageData(out, 0, 0);
    this.draw();
  }

  draw(): void {
    const [w, h, ratio] = [this.element.clientWidth, this.element.clientHeight, devicePixelRatio];
    if (this.#canvas.width !== Math.round(w * ratio)) this.#canvas.width = Math.round(w * ratio);
    if (this.#canvas.height !== Math.round(h * ratio)) this.#canvas.height = Math.round(h * ratio);
    const context = this.#canvas.getContext("2d");
    if (!context) return;
    const [a, b, c, d, e, f] = this.matrix();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, w, h);
    context.imageSmoothingEnabled = false;
    // Pixel centres are at whole indices, so the image begins half a pixel before.
    context.setTransform(ratio * a, ratio * b, ratio * c, ratio * d, ratio * e, ratio * f);
    context.drawImage(this.#image, -0.5, -0.5);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.#drawCross(context, w, h);
    this.#drawWire(context);
    this.#drawBrush(context);
    this.#title.textContent = `${this.view.name} ${this.index + 1} / ${this.view.slices}`;
  }

  #drawCross(context: CanvasRenderingContext2D, w: number, h: number): void {
    if (!this.cross) return;
    const [x, y] = this.screenAt(this.cross);
    context.strokeStyle = "#ffffff30";
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(x, 0);
    context.lineTo(x, h);
    context.moveTo(0, y);
    context.lineTo(w, y);
    context.stroke();
  }

  #line(context: CanvasRenderingContext2D, points: Point[], colour: string): void {
    if (points.length < 2) return;
    context.strokeStyle = colour;
    context.lineWidth = 2;
    context.beginPath();
    points.forEach((p, i) => {
      const [x, y] = this.screenAt(p);
      if (i) context.lineTo(x, y);
      else context.moveTo(x, y);
    });
    context.stroke();
  }

  #drawWire(context: CanvasRenderingContext2D): void {
    const wire = this.wire?.axis === this.view.axis && this.wire.slice === this.index ? this.wire : null;
    if (wire) this.#line(context, wire.fixed, "#ffffff");
    this.#line(context, this.path, this.closes ? "#7dff7d" : "#ffd24a");
    for (const p of [...(wire?.anchors ?? [])]) {
      const [x, y] = this.screenAt(p);
      context.fillStyle = "#ffffff";
      context.fillRect(x - 3, y - 3, 6, 6);
    }
    if (this.snapped) {
      const [x, y] = this.screenAt(this.snapped);
      context.strokeStyle = this.closes ? "#7dff7d" : "#ffd24a";
      context.strokeRect(x - 4, y - 4, 8, 8);
    }
  }

  #drawBrush(context: CanvasRenderingContext2D): void {
    if (!this.brush) return;
    const [x, y] = this.screenAt(this.brush.at);
    const [a, b] = this.matrix();
    context.strokeStyle = "#ffffff";
    context.lineWidth = 1;
    context.beginPath();
    context.arc(x, y, (this.brush.radius * Math.hypot(a, b)) / this.view.spacing_mm[0], 0, 2 * Math.PI);
    context.stroke();
  }
}
