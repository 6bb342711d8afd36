// Shaders. A soft surface is moved in the vertex shader: each vertex by the weighted displacements of four nodes.

import { ROW } from "./displacement";

const MOVE = `
in uvec4 nodes;
in vec4 weights;
uniform sampler2D displacement;
vec3 ofNode(uint n) { return texelFetch(displacement, ivec2(n % ${ROW}u, n / ${ROW}u), 0).xyz; }
vec3 ofVertex() {
  return weights.x * ofNode(nodes.x) + weights.y * ofNode(nodes.y) + weights.z * ofNode(nodes.z) + weights.w * ofNode(nodes.w);
}`;

const STILL = `
vec3 ofVertex() { return vec3(0.0); }`;

const MOVED = `
in vec3 moved;
vec3 ofVertex() { return moved; }`;

/** How the vertices of a surface get to where they are: not at all, from the nodes, or as they come from the server. */
export type Motion = "still" | "nodes" | "vertices";
const MOTIONS: Record<Motion, string> = { still: STILL, nodes: MOVE, vertices: MOVED };

export const surfaceVertex = (motion: Motion): string => `${MOTIONS[motion]}
out vec3 vNormal;
out vec3 vToEye;
out float vMoved;
void main() {
  vec3 d = ofVertex();
  vec4 p = modelViewMatrix * vec4(position + d, 1.0);
  vNormal = normalMatrix * normal;
  vToEye = -p.xyz;
  vMoved = length(d);
  gl_Position = projectionMatrix * p;
}`;

/** Lit from the eye; the rim is denser than the middle, so that transparent surfaces keep a shape. */
export const surfaceFragment = `
uniform vec3 colour;
uniform float opacity;
uniform float rim;
uniform float movedScale;
in vec3 vNormal;
in vec3 vToEye;
in float vMoved;
out vec4 pixel;
void main() {
  float facing = abs(dot(normalize(vNormal), normalize(vToEye)));
  // Displacement: from the structure's own colour over yellow to white.
  float t = movedScale > 0.0 ? clamp(vMoved / movedScale, 0.0, 1.0) : 0.0;
  vec3 c = mix(mix(colour, vec3(0.94, 0.89, 0.26), min(1.0, 2.0 * t)), vec3(1.0), max(0.0, 2.0 * t - 1.0));
  float alpha = clamp(opacity + rim * pow(1.0 - facing, 2.5) + 0.5 * t, 0.0, 1.0);
  // What is seen through would lose its rim to the shade.
  float light = opacity > 0.9 ? 0.25 + 0.75 * facing : 1.0;
  pixel = vec4(c * light, alpha);
}`;

/** What is nearest behind the slice: a back face means that the slice is inside the closed surface there. */
export const maskFragment = `
in vec3 vNormal;
in vec3 vToEye;
in float vMoved;
out vec4 pixel;
void main() { pixel = vec4(gl_FrontFacing ? 0.0 : 1.0); }`;

const CT = `
precision highp sampler3D;
uniform sampler3D ct;
uniform mat4 voxelFromPatient;
uniform vec3 dims;
uniform vec2 window;
uniform bool hasCt;
vec3 grey(vec3 p) {
  if (!hasCt) return vec3(0.0);
  vec3 uvw = ((voxelFromPatient * vec4(p, 1.0)).xyz + 0.5) / dims;
  if (any(lessThan(uvw, vec3(0.0))) || any(greaterThan(uvw, vec3(1.0)))) return vec3(0.0);
  return vec3(clamp((texture(ct, uvw).r - window.x) / window.y + 0.5, 0.0, 1.0));
}`;

const PLANE = `
uniform vec3 centre, right, up;
uniform vec2 halfExtent;`;

/** The whole slice, at rest. */
export const stillVertex = `${PLANE}
out vec3 from;
void main() {
  from = centre + right * position.x * halfExtent.x + up * position.y * halfExtent.y;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

/** Elements cut by the plane (see TetCut). */
export const tissueVertex = `${PLANE}
in vec3 rest;
out vec3 from;
void main() {
  from = rest;
  gl_Position = vec4((position.xy - vec2(dot(centre, right), dot(centre, up))) / halfExtent, 0.0, 1.0);
}`;

/** The CT at the place where the tissue was at rest. */
export const ctFragment = `${CT}
in vec3 from;
out vec4 pixel;
void main() { pixel = vec4(grey(from), 1.0); }`;

/** Where tissue was, before any is drawn where it is now. */
export const goneFragment = `
out vec4 pixel;
void main() { pixel = vec4(0.0, 0.0, 0.0, 1.0); }`;

export const marksVertex = `
out vec2 at;
void main() {
  at = position.xy;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

/** Over the CT: outlines of the deformed structures, plan, target, catheter, crosshair. Premultiplied. */
export const marksFragment = `${PLANE}
uniform vec3 normal, crosshair;
uniform float mmPerPixel;
uniform sampler2D brain, ventricles;
uniform vec3 entry, target, tip, axis;
uniform bool hasNeedle, hasOutlines;
in vec2 at;
out vec4 pixel;

float line(float distancePx, float width) { return 1.0 - smoothstep(width - 0.7, width + 0.7, distancePx); }

void over(vec3 colour, float alpha) { pixel = pixel * (1.0 - alpha) + vec4(colour, 1.0) * alpha; }

/// Distance in the plane to a segment seen along the normal, px; y: how far the nearest point is from the plane, mm.
vec2 segment(vec3 p, vec3 a, vec3 b) {
  vec3 n = normal;
  vec3 pa = p - a, ba = b - a;
  vec3 pf = pa - n * dot(pa, n), bf = ba - n * dot(ba, n);
  float t = clamp(dot(pf, bf) / max(dot(bf, bf), 1e-6), 0.0, 1.0);
  return vec2(length(pf - t * bf) / mmPerPixel, abs(dot(pa - t * ba, n)));
}

float outline(sampler2D mask, vec2 uv) {
  vec2 px = 1.0 / vec2(textureSize(mask, 0));
  float m = texture(mask, uv).r;
  float e = max(max(abs(m - texture(mask, uv + vec2(px.x, 0.0)).r), abs(m - texture(mask, uv - vec2(px.x, 0.0)).r)),
                max(abs(m - texture(mask, uv + vec2(0.0, px.y)).r), abs(m - texture(mask, uv - vec2(0.0, px.y)).r)));
  return smoothstep(0.15, 0.4, e);
}

void main() {
  pixel = vec4(0.0);
  vec3 p = centre + right * at.x * halfExtent.x + up * at.y * halfExtent.y;
  vec2 uv = at * 0.5 + 0.5;
  if (hasOutlines) {
    over(vec3(0.90, 0.62, 0.0), 0.9 * outline(brain, uv));
    over(vec3(0.34, 0.71, 0.91), outline(ventricles, uv));
  }
  vec2 x = abs(vec2(dot(p - crosshair, right), dot(p - crosshair, up))) / mmPerPixel;
  float gap = step(9.0, max(x.x, x.y));
  // An oblique plane need not hold the crosshair's point: it is fainter then.
  float held = abs(dot(crosshair - centre, normal)) < 1.0 ? 0.45 : 0.2;
  over(vec3(0.55), held * gap * line(min(x.x, x.y), 0.6));
  vec2 path = segment(p, entry, target);
  over(vec3(0.0, 0.85, 0.55), line(path.x, 1.0) * (path.y < 2.0 ? 1.0 : 0.35));
  float ring = length(vec2(dot(p - target, right), dot(p - target, up))) / mmPerPixel;
  over(vec3(0.0, 0.85, 0.55), line(abs(ring - 6.0), 1.0));
  if (hasNeedle) {
    vec2 n = segment(p, tip, tip - 250.0 * axis);
    float shaft = max(1.5 / mmPerPixel, 1.2);
    over(vec3(0.0), 0.8 * line(n.x, shaft + 1.2) * (n.y < 1.5 ? 1.0 : 0.3));
    over(vec3(1.0), line(n.x, shaft) * (n.y < 1.5 ? 1.0 : 0.3));
  }
}`;
