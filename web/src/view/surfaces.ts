// The surfaces of the case as geometries and materials.

import {
  BufferAttribute, BufferGeometry, Color, DoubleSide, DynamicDrawUsage, FrontSide, GLSL3, Mesh, ShaderMaterial, type Texture,
} from "three";
import type { Container, Point } from "../api";
import type { Snapshot } from "../snapshot";
import { maskFragment, surfaceFragment, surfaceVertex, type Motion } from "./shaders";

export type SurfaceName = "skin" | "brain" | "ventricles";

interface SurfaceHeader {
  name: SurfaceName;
  vertices: number;
  triangles: number;
  positions_at: number;
  indices_at: number;
  nodes_at?: number;
  weights_at?: number;
}

export interface SceneHeader {
  surfaces: SurfaceHeader[];
  node_count: number;
  nodes_at: number;
  tet_count: number;
  tets_at: number;
  plan: { entry_lps_mm: Point; target_lps_mm: Point; length_mm: number; side: string };
}

interface Look {
  colour: string;
  opacity: number;
  rim: number;
  order: number;
}

/** Colours of Okabe and Ito, told apart with any colour vision. */
const LOOKS: Record<SurfaceName, Look> = {
  ventricles: { colour: "#56b4e9", opacity: 0.95, rim: 0, order: 1 },
  brain: { colour: "#e69f00", opacity: 0.12, rim: 0.45, order: 2 },
  skin: { colour: "#cfc4ba", opacity: 0.06, rim: 0.45, order: 3 },
};

export interface Surface {
  name: SurfaceName;
  motion: Motion;
  mesh: Mesh<BufferGeometry, ShaderMaterial>;
}

/** The surfaces; `whole`: their vertices come moved from the server, else nodes move them here. */
export function surfaces(scene: Container, displacement: Texture, whole: boolean): Surface[] {
  const header = scene.header as SceneHeader;
  return header.surfaces.map((s) => {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(scene.floats(s.positions_at, 3 * s.vertices), 3));
    geometry.setIndex(new BufferAttribute(scene.words(s.indices_at, 3 * s.triangles), 1));
    geometry.computeVertexNormals();
    const soft = s.nodes_at !== undefined && s.weights_at !== undefined;
    const motion = !soft ? "still" : whole ? "vertices" : "nodes";
    if (motion === "vertices") {
      geometry.setAttribute("moved", new BufferAttribute(new Float32Array(3 * s.vertices), 3).setUsage(DynamicDrawUsage));
    } else if (s.nodes_at !== undefined && s.weights_at !== undefined) {
      geometry.setAttribute("nodes", new BufferAttribute(scene.words(s.nodes_at, 4 * s.vertices), 4));
      geometry.setAttribute("weights", new BufferAttribute(scene.floats(s.weights_at, 4 * s.vertices), 4));
    }
    const mesh = new Mesh(geometry, look(LOOKS[s.name], motion, displacement));
    mesh.renderOrder = LOOKS[s.name].order;
    // The GPU moves it: the bounds at rest do not say what is in view.
    mesh.frustumCulled = false;
    return { name: s.name, motion, mesh };
  });
}

function look({ colour, opacity, rim }: Look, motion: Motion, displacement: Texture): ShaderMaterial {
  const opaque = opacity > 0.9;
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: surfaceVertex(motion),
    fragmentShader: surfaceFragment,
    side: FrontSide,
    transparent: !opaque,
    depthWrite: opaque,
    uniforms: {
      displacement: { value: displacement },
      colour: { value: new Color(colour).convertLinearToSRGB() },
      opacity: { value: opacity },
      rim: { value: rim },
      movedScale: { value: 0 },
    },
  });
}

/** Moves the vertices of the soft surfaces by what the server sent of them. */
export function moveVertices(all: Surface[], { quantum, displacements }: Snapshot): void {
  let from = 0;
  for (const { motion, mesh } of all) {
    const moved = mesh.geometry.attributes["moved"];
    if (motion !== "vertices" || !(moved instanceof BufferAttribute)) continue;
    const to = moved.array;
    if (from + to.length > displacements.length) throw new Error("The snapshot belongs to another mesh: reload the page.");
    for (let i = 0; i < to.length; i++) to[i] = displacements[from + i]! * quantum;
    from += to.length;
    moved.needsUpdate = true;
  }
}

/** The material with which a surface is cut by a slice. */
export function maskMaterial(motion: Motion, displacement: Texture): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: surfaceVertex(motion),
    fragmentShader: maskFragment,
    side: DoubleSide,
    uniforms: { displacement: { value: displacement } },
  });
}
