// Emulated glasses (iwer: immersive-ar), and where the page draws the catheter in their room.

import { createRequire } from "node:module";
import { honest, pretendFrozen } from "./tracker.mjs";

const EMULATOR = createRequire(import.meta.url).resolve("iwer/build/iwer.min.js");
/** Somewhere, looking somewhere: x, y, z of the place, m, and of the quaternion, w last. */
const PLACE = [0.4, 1.5, -0.3];
const TURN = [0.1, 0.5, -0.2, 0.8].map((v) => v / Math.hypot(0.1, 0.5, -0.2, 0.8));

/** Installs the emulator before the page's own scripts run; its room starts where it is then. */
export async function putOnGlasses(page, modes = ["inline", "immersive-vr", "immersive-ar"]) {
  await page.addInitScript({ path: EMULATOR });
  await page.addInitScript((supportedSessionModes) => {
    const device = new window.IWER.XRDevice({ ...window.IWER.metaQuest3, supportedSessionModes });
    device.installRuntime({ forceInstall: true });
    window.emulated = device;
  }, modes);
}

/** As glasses that cannot show the room: only immersive-vr. */
export const putOnDarkGlasses = (page) => putOnGlasses(page, ["inline", "immersive-vr"]);

/** The wearer walks away from where the room starts. */
export function walk(page) {
  return page.evaluate(([place, turn]) => {
    // The room starts where the emulator starts: 1.6 m above its floor.
    window.emulated.position.set(place[0], place[1] + 1.6, place[2]);
    window.emulated.quaternion.set(...turn);
  }, [PLACE, TURN]);
}

const rotate = ([x, y, z, w], v) => {
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const t = cross([x, y, z], v).map((c) => 2 * c);
  const u = cross([x, y, z], t);
  return v.map((c, i) => c + w * t[i] + u[i]);
};

/** From the frame of the wearer's eye to the room. */
export const inRoom = (p) => rotate(TURN, p).map((v, i) => v + PLACE[i]);

/** Where the numbers of the API put the tip, m in the room. */
export function expectedTip({ display_from_patient: { quaternion_wxyz: [w, x, y, z], translation_mm }, tip_lps_mm }) {
  return inRoom(rotate([x, y, z, w], tip_lps_mm).map((v, i) => (v + translation_mm[i]) / 1000));
}

/** What the panels before the wearer say, line by line. */
export const saidBy = (page) => page.evaluate(() => window.monro.glasses.panels.said.split("\n"));

/** By how much the greys of zoom and MPR vary over each picture. */
function spreads(page) {
  return page.evaluate(() => {
    const { stage: { renderer }, glasses } = window.monro;
    return glasses.panels.pictures.map((target) => {
      const { width, height } = target;
      const pixels = new Uint8Array(4 * width * height);
      renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
      const greys = [...pixels].filter((_, i) => i % 4 === 1);
      const mean = greys.reduce((a, b) => a + b) / greys.length;
      return Math.sqrt(greys.reduce((a, b) => a + (b - mean) ** 2, 0) / greys.length);
    });
  });
}

/** The lines of numbers, in their order, and what the API calls them. */
const LINES = [
  ["distance_to_target_mm", /^([\d.-]+) mm$/], ["distance_to_target_rigid_mm", /^rigid ([\d.-]+) mm$/],
  ["entry_angle_error_deg", /^angle ([\d.-]+)°$/], ["depth_mm", /^depth ([\d.-]+) mm$/],
];

/**
 * Waits until the panels say what the API tells, each line for itself: a slow display shows a frame that the API has left behind,
 * and the catheter rests only for a while.
 */
export async function panelsAgree(page, api, until) {
  for (const [name, line] of LINES) {
    await until(`${name} in the glasses as the API tells it`, async () => {
      const [a, said, b] = [await api("/api/guidance"), await saidBy(page), await api("/api/guidance")];
      const shown = Number.parseFloat(said.map((text) => text.match(line)?.[1]).find(Boolean));
      return a[name] !== null && b[name] !== null && shown >= Math.min(a[name], b[name]) - 0.06 && shown <= Math.max(a[name], b[name]) + 0.06;
    });
  }
  await until("a place by the tracker", async () => (await saidBy(page)).includes("Placed by the tracker"));
  await until("zoom and three slices, not blank", async () => {
    const found = await spreads(page);
    return found.length === 4 && found.every((s) => s > 4);
  });
}

/** Where the tip of the catheter is drawn, and where the planned target is, m in the room. */
export function drawn(page) {
  return page.evaluate(() => {
    const { stage, glasses } = window.monro;
    const target = stage.world.scene.position.clone().set(...stage.tissue.header.plan.target_lps_mm);
    return { tip: stage.world.drawnTip().toArray(), target: target.applyMatrix4(glasses.anchor.roomFromPatient).toArray() };
  });
}

/** With the registration void the patient is shown nowhere, and that is why: not because the glasses were lost. */
export async function voidIsSaid(page, until) {
  await page.evaluate(() => {
    const { glasses } = window.monro;
    const take = glasses.take.bind(glasses);
    glasses.take = (g) => take(g && { ...g, phase: "calibrated", display_from_patient: null });
  });
  // Of a place that is not known nothing is drawn.
  const shown = () => page.evaluate(() => window.monro.glasses.anchor.placedAt !== null);
  await until("not registered", async () => (await saidBy(page)).some((line) => line.startsWith("Not registered")) && !(await shown()));
  await page.evaluate(() => void delete window.monro.glasses.take);
  await until("placed again", async () => (await saidBy(page)).includes("Placed by the tracker") && (await shown()));
}

/** Poses that are frozen look sound in the glasses, too: that they are is said there as on the page. */
export async function troubleIsSaid(page, until) {
  const said = async () => (await saidBy(page)).some((line) => /^⚠ .*Poses do not change: 'Catheter'/.test(line));
  await pretendFrozen(page);
  await until("frozen poses", said);
  await honest(page);
  await until("no trouble any more", async () => !(await said()));
}
