// The simulation's nodes: their displacements as a texture, so that surfaces are deformed where they are drawn, and their
// places for the slices.

import { DataTexture, FloatType, NearestFilter, RGBAFormat } from "three";
import type { Snapshot } from "../snapshot";

/** Texels in a row; the shader must agree. */
export const ROW = 1024;

export class Displacement {
  readonly texture: DataTexture;
  /** Places of the nodes now, mm. */
  readonly nodes: Float32Array;
  /** Places of the nodes at rest, mm. */
  readonly rest: Float32Array;
  readonly #data: Float32Array<ArrayBuffer>;

  constructor(rest: Float32Array) {
    this.rest = rest;
    this.nodes = rest.slice();
    const rows = Math.max(1, Math.ceil(rest.length / 3 / ROW));
    this.#data = new Float32Array(4 * ROW * rows);
    this.texture = new DataTexture(this.#data, ROW, rows, RGBAFormat, FloatType);
    this.texture.minFilter = this.texture.magFilter = NearestFilter;
    this.texture.needsUpdate = true;
  }

  /** Takes the nodes' displacements. */
  take({ quantum, displacements }: Snapshot): void {
    if (displacements.length !== this.rest.length) throw new Error("The snapshot belongs to another mesh: reload the page.");
    for (let from = 0, to = 0; from < displacements.length; to++) { // the fourth channel stays
      for (let axis = 0; axis < 3; axis++, from++, to++) {
        const moved = displacements[from]! * quantum;
        this.#data[to] = moved;
        this.nodes[from] = this.rest[from]! + moved;
      }
    }
    this.texture.needsUpdate = true;
  }
}
