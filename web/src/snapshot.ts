// A binary snapshot; the layout stands in crates/server/src/snapshot.rs.

import type { Guidance } from "./api";

export const VERSION = 1;
const HEADER = 56;

/** Poses older than this are stale; the server's rule. */
const STALE_MS = 100;

export interface Snapshot {
  sequence: number;
  step: number;
  /** When the server took it, ms on this page's clock (see Stream). */
  at: number;
  /** Whether the displacements are those of the soft surfaces' vertices, in the scene's order, and not those of the nodes. */
  whole: boolean;
  /** Displacement of each node or vertex is `quantum` times three of these, mm. */
  quantum: number;
  displacements: Int16Array;
  guidance: Guidance;
}

/** What the numbers are when the snapshot has waited for so long: older, and no longer live if they are too old. */
export function aged(guidance: Guidance, waitedMs: number): Guidance {
  const add = (age: number | null): number | null => (age === null ? null : age + waitedMs);
  const [age_ms, deformation_age_ms] = [add(guidance.age_ms), add(guidance.deformation_age_ms)];
  const state = guidance.state === "live" && (age_ms ?? 0) > STALE_MS ? "stale" : guidance.state;
  return { ...guidance, age_ms, deformation_age_ms, state };
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
    at: performance.now(),
    whole: (view.getUint8(3) & 4) !== 0,
    quantum: view.getFloat32(44, true),
    displacements: new Int16Array(buffer, HEADER, 3 * nodes),
    guidance: JSON.parse(new TextDecoder().decode(json)) as Guidance,
  };
}
