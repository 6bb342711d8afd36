// A binary snapshot; the layout stands in crates/server/src/snapshot.rs.

import type { Guidance } from "./api";

export const VERSION = 1;
const HEADER = 56;

export interface Snapshot {
  sequence: number;
  step: number;
  /** Displacement of each node is `quantum` times three of these, mm. */
  quantum: number;
  displacements: Int16Array;
  guidance: Guidance;
}

export function decode(buffer: ArrayBuffer): Snapshot {
  const view = new DataView(buffer);
  if (view.getUint8(0) !== VERSION) {
    throw new Error(`Snapshot version ${view.getUint8(0)}, but this page reads ${VERSION}: reload the page.`);
  }
  const nodes = view.getUint32(48, true);
  const json = new Uint8Array(buffer, HEADER + 6 * nodes, view.getUint32(52, true));
  return {
    sequence: view.getUint32(4, true),
    step: view.getUint32(40, true),
    quantum: view.getFloat32(44, true),
    displacements: new Int16Array(buffer, HEADER, 3 * nodes),
    guidance: JSON.parse(new TextDecoder().decode(json)) as Guidance,
  };
}
