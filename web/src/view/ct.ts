// The CT as a 3D texture of half-precision HU.

import { Data3DTexture, HalfFloatType, LinearFilter, Matrix4, RedFormat, Vector2, Vector3, type IUniform } from "three";
import type { Container } from "../api";

interface CtHeader {
  dims: [number, number, number];
  patient_from_voxel: [number, number, number, number][];
  hu_at: number;
}

/** What the shaders need of it, shared by all slices. */
export type Ct = Record<"ct" | "voxelFromPatient" | "dims" | "window" | "hasCt", IUniform>;

/** Window centre and width, HU. */
export const WINDOWS = {
  Brain: [40, 80],
  Stroke: [35, 40],
  Subdural: [75, 215],
  Bone: [500, 2000],
} as const satisfies Record<string, readonly [number, number]>;

/** Of a case that was shared without its images: black slices. */
function none(): Ct {
  return {
    ct: { value: null }, hasCt: { value: false }, voxelFromPatient: { value: new Matrix4() },
    dims: { value: new Vector3(1, 1, 1) }, window: { value: new Vector2(...WINDOWS.Brain) },
  };
}

export function ct(container: Container | null): Ct {
  if (!container) return none();
  const header = container.header as CtHeader;
  const [columns, rows, slices] = header.dims;
  const texture = new Data3DTexture(container.halves(header.hu_at, columns * rows * slices), columns, rows, slices);
  texture.format = RedFormat;
  texture.type = HalfFloatType;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.unpackAlignment = 2;
  texture.needsUpdate = true;
  const m = header.patient_from_voxel.flat() as [number, number, number, number, ...number[]];
  const patientFromVoxel = new Matrix4().fromArray([...m, 0, 0, 0, 1]).transpose();
  return {
    ...none(), ct: { value: texture }, hasCt: { value: true }, voxelFromPatient: { value: patientFromVoxel.invert() },
    dims: { value: new Vector3(...header.dims) },
  };
}
