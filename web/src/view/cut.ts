// The deformed tetrahedra cut by a plane. Inside an element the way back to rest is affine, so that each polygon carries
// the rest positions of its corners, and interpolation over the polygon gives the exact rest position of every pixel: the
// place at which the CT of the deformed tissue is looked up. The same rules as session::DeformedSampler: inverted elements
// are left out, outside of the mesh nothing moves, and where tissue was and is no more there is nothing.

import type { Plane } from "./plane";

/** Corners behind and in front of the plane, by the bits of the corners in front. */
const SIDES = Array.from({ length: 16 }, (_, bits) => {
  const corners = [0, 1, 2, 3];
  return { front: corners.filter((c) => bits & (1 << c)), back: corners.filter((c) => !(bits & (1 << c))) };
});
const FLOATS = 5;

export class TetCut {
  /** For each corner of each triangle: mm along the plane's right and up (from the patient's origin), rest position. */
  data = new Float32Array(FLOATS * 4096);
  /** Corners in `data`. */
  count = 0;
  readonly #rest: Float32Array;
  readonly #tets: Uint32Array;
  readonly #side: Float32Array;

  constructor(rest: Float32Array, tets: Uint32Array) {
    this.#rest = rest;
    this.#tets = tets;
    this.#side = new Float32Array(rest.length / 3);
  }

  /** Cuts the elements with their nodes at `nodes` (mm). */
  cut(nodes: Float32Array, plane: Plane): void {
    const { x, y, z } = plane.normal;
    const [offset, side, tets] = [plane.offset, this.#side, this.#tets];
    for (let n = 0, i = 0; n < side.length; n++, i += 3) side[n] = nodes[i]! * x + nodes[i + 1]! * y + nodes[i + 2]! * z - offset;
    this.count = 0;
    for (let t = 0; t < tets.length; t += 4) {
      const bits = +(side[tets[t]!]! > 0) | (+(side[tets[t + 1]!]! > 0) << 1) | (+(side[tets[t + 2]!]! > 0) << 2) | (+(side[tets[t + 3]!]! > 0) << 3);
      if (bits !== 0 && bits !== 15 && volume(nodes, tets, t) > 0) this.#element(nodes, plane, t, bits);
    }
  }

  #element(nodes: Float32Array, plane: Plane, t: number, bits: number): void {
    if ((this.count + 6) * FLOATS > this.data.length) {
      const grown = new Float32Array(2 * this.data.length);
      grown.set(this.data);
      this.data = grown;
    }
    const { front, back } = SIDES[bits]!;
    const edge = (f: number, b: number): void => this.#corner(nodes, plane, this.#tets[t + f]!, this.#tets[t + b]!);
    if (front.length === 2) {
      const [f, g] = front as [number, number];
      const [b, c] = back as [number, number];
      edge(f, b), edge(f, c), edge(g, c);
      edge(f, b), edge(g, c), edge(g, b);
    } else if (front.length === 1) {
      back.forEach((b) => edge(front[0]!, b));
    } else {
      front.forEach((f) => edge(f, back[0]!));
    }
  }

  /** Where the edge between two nodes meets the plane; computed in one order, so that neighbours leave no gap. */
  #corner(nodes: Float32Array, plane: Plane, m: number, n: number): void {
    const [a, b] = m < n ? [m, n] : [n, m];
    const t = this.#side[a]! / (this.#side[a]! - this.#side[b]!);
    const mix = (of: Float32Array, axis: number): number => of[3 * a + axis]! + t * (of[3 * b + axis]! - of[3 * a + axis]!);
    const [x, y, z] = [mix(nodes, 0), mix(nodes, 1), mix(nodes, 2)];
    const { right, up } = plane;
    const at = FLOATS * this.count++;
    this.data[at] = x * right.x + y * right.y + z * right.z;
    this.data[at + 1] = x * up.x + y * up.y + z * up.z;
    for (let axis = 0; axis < 3; axis++) this.data[at + 2 + axis] = mix(this.#rest, axis);
  }
}

/** Six times the signed volume of an element. */
function volume(p: Float32Array, tets: Uint32Array, t: number): number {
  const [a, b, c, d] = [3 * tets[t]!, 3 * tets[t + 1]!, 3 * tets[t + 2]!, 3 * tets[t + 3]!];
  const [bx, by, bz] = [p[b]! - p[a]!, p[b + 1]! - p[a + 1]!, p[b + 2]! - p[a + 2]!];
  const [cx, cy, cz] = [p[c]! - p[a]!, p[c + 1]! - p[a + 1]!, p[c + 2]! - p[a + 2]!];
  const [dx, dy, dz] = [p[d]! - p[a]!, p[d + 1]! - p[a + 1]!, p[d + 2]! - p[a + 2]!];
  return bx * (cy * dz - cz * dy) + by * (cz * dx - cx * dz) + bz * (cx * dy - cy * dx);
}
