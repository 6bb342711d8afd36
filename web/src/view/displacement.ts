// Displacements of the simulation's nodes as a texture, so that surfaces are deformed where they are drawn.

import { DataTexture, FloatType, NearestFilter, RGBAFormat } from "three";
import type { Snapshot } from "../snapshot";

/** Texels in a row; the shader must agree. */
export const ROW = 1024;

export class Displacement {
  readonly texture: DataTexture;
  readonly #data: Float32Array<ArrayBuffer>;
  #step = -1;

  constructor(nodes: number) {
    const rows = Math.max(1, Math.ceil(nodes / ROW));
    this.#data = new Float32Array(4 * ROW * rows);
    this.texture = new DataTexture(this.#data, ROW, rows, RGBAFormat, FloatType);
    this.texture.minFilter = this.texture.magFilter = NearestFilter;
    this.texture.needsUpdate = true;
  }

  /** Takes a snapshot; returns whether the tissue has moved since the last one. */
  take({ step, quantum, displacements }: Snapshot): boolean {
    if (step === this.#step) return false;
    this.#step = step;
    for (let from = 0, to = 0; from < displacements.length; to += 4) {
      for (let axis = 0; axis < 3; axis++) this.#data[to + axis] = (displacements[from++] ?? 0) * quantum;
    }
    this.texture.needsUpdate = true;
    return true;
  }
}
