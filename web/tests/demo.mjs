// The demo as a user starts it: its view opens, moves, agrees with the API, and is reloaded in mid-insertion.

import assert from "node:assert/strict";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

/** The whole chain on the phantom, with assertions on. */
const LONG_S = 600;

/** `start(args)` runs the command and gives its first JSON line that has a `url`, with its process and its API. */
export async function demoInBrowser(start, open, { until, text, number, moves, shot }) {
  const dir = mkdtempSync(join(tmpdir(), "monro-demo-"));
  const out = join(dir, "demo");
  const { url, token, api, child } = await start(["demo", "--live", "--json", "--out", out], LONG_S);
  try {
    const p = await open(`${url}/#token=${token}`);
    await until("a live signal", async () => (await text(p, "#signal span")) === "Live");
    await numbersAgree(p, api, { until, number, moves });
    await dragSlice(p, { until, text });
    await shot(p, "demo");
    await reload(p, api, { until, text, number });
    assert.deepEqual(p.faults, []);
    assert.ok(existsSync(join(out, "insertion", "report.html")));
  } finally {
    child.kill();
    rmSync(dir, { recursive: true, force: true });
  }
}

/**
 * While the hand moves, and where it moves little: what the page shows lies between what the API tells before and after.
 * Tissue that creeps on a busy machine is never quite at rest.
 */
async function numbersAgree(p, api, { until, number, moves }) {
  await moves(p);
  for (const [id, name] of [["#n-distance", "distance_to_target_mm"], ["#n-rigid", "distance_to_target_rigid_mm"], ["#n-angle", "entry_angle_error_deg"], ["#n-depth", "depth_mm"]]) {
    await until(`${name} on the page as the API tells it`, async () => {
      const [a, shown, b] = [await api("/api/guidance"), await number(p, id), await api("/api/guidance")];
      if (a[name] === null || b[name] === null) return false;
      const [least, most] = [Math.min(a[name], b[name]), Math.max(a[name], b[name])];
      return most - least < 0.5 && shown >= least - 0.061 && shown <= most + 0.061;
    });
  }
}

async function dragSlice(p, { until, text }) {
  const before = await text(p, "#axial output");
  const box = await p.locator("#axial").boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await p.mouse.move(x, y);
  await p.mouse.down();
  await p.mouse.move(x + 30, y + 20, { steps: 4 });
  await p.mouse.up();
  await until("the end of the following", async () => !(await p.getByLabel("follows the tip").isChecked()));
  await p.locator("#axial").focus();
  await p.keyboard.press("PageUp");
  await until("another slice", async () => (await text(p, "#axial output")) !== before);
  await p.getByLabel("follows the tip").check();
}

/** The session does not notice; the page goes on where the hand is by then. */
async function reload(p, api, { until, text, number }) {
  const length = (await api("/api/case")).plan.length_mm;
  await until("the middle of an insertion", async () => {
    const { depth_mm: depth } = await api("/api/guidance");
    return depth > 0.2 * length && depth < 0.6 * length;
  });
  const before = await api("/api/guidance");
  await p.reload();
  await until("a live signal", async () => (await text(p, "#signal span")) === "Live");
  assert.match(await text(p, "#signal small"), /Navigating/);
  // What the page shows lies between what the API told a moment ago and what it tells now.
  await until("the page where the hand is", async () => {
    const [a, , shown, b] = [await api("/api/guidance"), await p.waitForTimeout(1000), await number(p, "#n-depth"), await api("/api/guidance")];
    return shown >= Math.min(a.depth_mm, b.depth_mm) - 0.06 && shown <= Math.max(a.depth_mm, b.depth_mm) + 0.06;
  });
  const after = await api("/api/guidance");
  assert.ok(after.time_s > before.time_s && after.phase === "navigating", JSON.stringify([before, after]));
}
