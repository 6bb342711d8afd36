// Planes through the patient (LPS, mm), in the radiological convention: seen from the feet, the front, the patient's left.

import { Vector3 } from "three";

export type Facing = "axial" | "coronal" | "sagittal";

const AXES: Record<Facing, { right: Vector3; up: Vector3 }> = {
  axial: { right: new Vector3(1, 0, 0), up: new Vector3(0, -1, 0) },
  coronal: { right: new Vector3(1, 0, 0), up: new Vector3(0, 0, 1) },
  sagittal: { right: new Vector3(0, 1, 0), up: new Vector3(0, 0, 1) },
};
const LETTERS: [keyof Vector3 & ("x" | "y" | "z"), string, string][] = [["x", "L", "R"], ["y", "P", "A"], ["z", "S", "I"]];
/** Sine of the least angle between a line and the normal of the slice that is turned to hold it. */
const LEAST = 0.3;

/** The anatomical direction of a vector: its largest component, and further ones above a half. */
export function letters(v: Vector3): string {
  const parts = LETTERS.map(([axis, plus, minus]) => [Math.abs(v[axis]), v[axis] > 0 ? plus : minus] as const);
  parts.sort((a, b) => b[0] - a[0]);
  return parts.filter(([size], i) => i === 0 || size > 0.5).map(([, letter]) => letter).join("");
}

export class Plane {
  /** Screen right and up, and towards the viewer. */
  readonly right = new Vector3();
  readonly up = new Vector3();
  readonly normal = new Vector3();
  /** Middle of the view. */
  readonly centre = new Vector3();

  constructor(facing: Facing, centre: Vector3) {
    this.face(AXES[facing].right, AXES[facing].up);
    this.centre.copy(centre);
  }

  private face(right: Vector3, up: Vector3): void {
    this.right.copy(right);
    this.up.copy(up);
    this.normal.crossVectors(right, up);
  }

  /** Distance from the origin along the normal, mm. */
  get offset(): number {
    return this.centre.dot(this.normal);
  }

  /** Moves along the normal until it holds a point. */
  through(p: Vector3): void {
    this.centre.addScaledVector(this.normal, p.dot(this.normal) - this.offset);
  }

  /**
   * Turns it to hold a direction, upright and as near to a standard slice as can be; where that slice is nearly at a
   * right angle to the direction, the axial one is turned instead.
   */
  along(direction: Vector3, facing: Facing): void {
    const { right, up } = AXES[facing];
    const normal = right.clone().cross(up);
    const across = direction.dot(normal);
    if (Math.hypot(...direction.clone().addScaledVector(normal, -across).toArray()) < LEAST && facing !== "axial") {
      this.along(direction, "axial");
      return;
    }
    normal.addScaledVector(direction, -across).normalize();
    const turned = right.clone().addScaledVector(normal, -right.dot(normal)).normalize();
    this.face(turned, normal.clone().cross(turned));
  }

  /** The point at mm to the right and up of the middle. */
  at(x: number, y: number): Vector3 {
    return this.centre.clone().addScaledVector(this.right, x).addScaledVector(this.up, y);
  }

  /** Letters for the left, right, upper and lower edge. */
  letters(): [string, string, string, string] {
    return [this.right.clone().negate(), this.right, this.up, this.up.clone().negate()].map(letters) as [string, string, string, string];
  }
}
