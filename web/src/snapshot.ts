// A binary snapshot; the layout stands in crates/server/src/snapshot.rs.

import { NOTHING, type Guidance } from "./api";

export const VERSION = 1;
const HEADER = 56;

/** From these ages on poses are stale, or lost; the server's rule. */
export const [STALE_MS, LOST_MS] = [100, 500];
/** What a soft body takes with it that has fallen behind as far as a lost catheter: it says where the tissue was. */
const BEHIND = {
  distance_to_target_mm: null, miss_mm: null, in_ventricle: null, tip_in: null, csf_depth_mm: null, axial_force_mn: null, kakarla_grade: null,
  target_lps_mm: null, target_in_eye_mm: null,
} as const satisfies Partial<Guidance>;
/** What a lost catheter takes with it. */
const GONE = {
  ...NOTHING, ...BEHIND, state: "lost", distance_to_target_rigid_mm: null, entry_offset_mm: null, entry_angle_error_deg: null, depth_mm: null,
  eye_right_lps: null,
} as const satisfies Partial<Guidance>;

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

/** What the numbers are when the snapshot has waited for so long: older, stale or gone if they are too old. */
export function aged(guidance: Guidance, waitedMs: number): Guidance {
  const add = (age: number | null): number | null => (age === null ? null : age + waitedMs);
  const [age_ms, deformation_age_ms, display_age_ms] = [add(guidance.age_ms), add(guidance.deformation_age_ms), add(guidance.display_age_ms)];
  const from = (limit: number, age: number | null): boolean => age !== null && age >= limit;
  const older = { ...guidance, age_ms, deformation_age_ms, display_age_ms, ...(from(LOST_MS, deformation_age_ms) ? BEHIND : {}) };
  if (from(LOST_MS, age_ms)) return { ...older, ...GONE };
  return guidance.state === "live" && from(STALE_MS, age_ms) ? { ...older, state: "stale" } : older;
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
