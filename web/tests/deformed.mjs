// The slices that the page shows against the same slices made in software (crates/server/examples/deformed_slice.rs).

import { spawn } from "node:child_process";
import { dirname, join } from "node:path";

const SLICES = ["axial", "along-coronal"];
/** Grey levels that count as a difference. */
const LEVELS = 4;
/** Pixels beside the crosshair that are left out. */
const MARGIN = 2;

/** Greys of the reference renderer, row by row. */
async function reference(request) {
  const command = join(dirname(process.argv[2]), "deformed_slice");
  const child = spawn(command, [], { stdio: ["pipe", "pipe", "inherit"] });
  child.stdin.end(JSON.stringify(request));
  const parts = [];
  for await (const part of child.stdout) parts.push(part);
  return JSON.parse(Buffer.concat(parts).toString());
}

/** Pixels (r, g, b, a) of a PNG, decoded by a page of its own. */
async function pixels(browser, png) {
  const page = await browser.newPage();
  const out = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    context.drawImage(bitmap, 0, 0);
    return [...context.getImageData(0, 0, bitmap.width, bitmap.height).data];
  }, png.toString("base64"));
  await page.close();
  return out;
}

/** What is shown in a pane: geometry, and where the crosshair is in it, px. */
function shown(page, id) {
  return page.evaluate((id) => {
    const { slices, tissue } = window.monro.stage;
    const { pane, slice } = slices.find((s) => s.pane.id === id);
    // Letters over the picture are not part of it.
    for (const e of pane.children) e.style.visibility = "hidden";
    const box = pane.getBoundingClientRect();
    const size = [pane.clientWidth, pane.clientHeight];
    // Where the renderer puts it: whole pixels from the canvas's lower edge.
    const stage = document.querySelector("#stage").getBoundingClientRect();
    const x = stage.left + Math.round(box.left + pane.clientLeft - stage.left);
    const y = stage.bottom - Math.round(stage.bottom - box.top - pane.clientTop - size[1]) - size[1];
    const { centre, right, up } = slice.plane;
    const mm = slice.mmPerPixel(...size);
    const at = slice.crosshair.clone().sub(centre);
    return {
      clip: { x, y, width: size[0], height: size[1] },
      cross: [size[0] / 2 + at.dot(right) / mm, size[1] / 2 - at.dot(up) / mm],
      request: {
        nodes: [...tissue.displacement.nodes], centre: centre.toArray(), right: right.toArray(), up: up.toArray(),
        mm_per_pixel: mm, size, window: tissue.ct.window.value.toArray(),
      },
    };
  }, id);
}

/** Differences where nothing is drawn over the CT. */
function compare(picture, greys, { cross, request }) {
  const width = request.size[0];
  let [sum, beyond, compared] = [0, 0, 0];
  greys.forEach((grey, i) => {
    const [r, g, b] = picture.slice(4 * i, 4 * i + 3);
    const [x, y] = [(i % width) + 0.5, Math.floor(i / width) + 0.5];
    if (r !== g || g !== b || Math.abs(x - cross[0]) < MARGIN || Math.abs(y - cross[1]) < MARGIN) return;
    const difference = Math.abs(r - grey);
    compared++;
    sum += difference;
    if (difference > LEVELS) beyond++;
  });
  return { mean: sum / compared, beyond: beyond / compared, compared };
}

/** Moves the page's tissue by several millimetres around the crosshair, more than any catheter does, and holds it so. Its border stays: along
 * a gap of a hundredth of a millimetre the pixels would fall to either side by chance. */
export function deform(page) {
  return page.evaluate(() => {
    const { stage } = window.monro;
    const { rest } = stage.tissue.displacement;
    const [centre, quantum] = [stage.crosshair.toArray(), 1e-3];
    const displacements = new Int16Array(rest.length);
    for (let n = 0; n < rest.length; n += 3) {
      const square = [0, 1, 2].reduce((sum, a) => sum + (rest[n + a] - centre[a]) ** 2, 0);
      [5000, -4000, 3000].forEach((most, a) => (displacements[n + a] = most * Math.exp(-square / (2 * 14 ** 2))));
    }
    const nothing = { tip_lps_mm: null, axis_lps: null, eye_up_lps: null, target_lps_mm: null, target_in_eye_mm: null, predicted_tre_mm: null, display_from_patient: null, display_age_ms: null };
    stage.take({ step: -2, whole: false, quantum, displacements, guidance: nothing });
    // What comes from the server waits meanwhile.
    stage.take = () => undefined;
  });
}

/** The page follows the server again. */
export function relax(page) {
  return page.evaluate(() => delete window.monro.stage.take);
}

/** The page rests; its slices are compared, as they are and with the CT as scanned. */
export async function deformedSlices(page, browser, folder) {
  const out = [];
  await page.getByLabel("outlines").uncheck();
  for (const name of SLICES) {
    const view = await shown(page, name);
    const greys = await reference({ case: folder, ...view.request });
    const take = async () => {
      // Drawn, and shown, however slow the machine is.
      await page.evaluate(() => new Promise((shown) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(shown)))));
      return compare(await pixels(browser, await page.screenshot({ clip: view.clip })), greys, view);
    };
    const deformed = await take();
    await page.getByLabel("deformed with the tissue").uncheck();
    const asScanned = await take();
    await page.getByLabel("deformed with the tissue").check();
    out.push({ name, deformed, asScanned, compared: deformed.compared });
  }
  await page.evaluate(() => document.querySelectorAll(".slice > *").forEach((e) => (e.style.visibility = "")));
  await page.getByLabel("outlines").check();
  return out;
}
