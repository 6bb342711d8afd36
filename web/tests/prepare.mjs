// A scan becomes a case in the browser, and the live session goes on at the same address.

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";

/** The command, beside the examples. */
const MONRO = join(dirname(dirname(process.argv[2])), "monro");
/** Preparing takes seconds on a quiet machine. */
const LONG_MS = 300_000;

/** `open(address)` gives a watched page, `shot(page, name)` keeps a picture. */
export async function prepareInBrowser(open, shot) {
  const dir = mkdtempSync(join(tmpdir(), "monro-prepare-"));
  const out = join(dir, "case");
  execFileSync(MONRO, ["phantom", "--out", join(dir, "scans", "phantom")], { stdio: "ignore" });
  const server = spawn(MONRO, ["serve", "--json", "--scans", join(dir, "scans"), "--out", out, "--no-igtl", "--no-record"], { stdio: ["ignore", "pipe", "ignore"] });
  try {
    const { url, token } = JSON.parse(await new Promise((resolve) => createInterface(server.stdout).once("line", resolve)));
    const page = await open(`${url}/#token=${token}`);
    await prepare(page, shot);
    const planned = await movePath(page, shot);
    assert.ok(!existsSync(out), "the case is written before it was asked for");
    await page.getByRole("button", { name: "Write the case and navigate" }).click();
    await page.waitForFunction(() => document.querySelector("#signal span")?.textContent === "Live", null, { timeout: LONG_MS });
    assert.equal(new URL(page.url()).origin, url);
    const headers = { Authorization: `Bearer ${token}` };
    const { plan } = await (await fetch(`${url}/api/case`, { headers })).json();
    assert.ok(Math.hypot(...plan.target_lps_mm.map((v, i) => v - planned[i])) < 1e-3, "the path that was moved is the path that is followed");
    assert.deepEqual(page.faults, []);
    await shot(page, "prepared-and-live");
  } finally {
    server.kill();
    rmSync(dir, { recursive: true, force: true });
  }
}

async function prepare(page, shot) {
  await page.getByRole("button", { name: "Prepare" }).click();
  await page.locator("#stages .running").waitFor();
  await shot(page, "preparing");
  await page.waitForFunction(() => window.monro, null, { timeout: LONG_MS });
  assert.equal(await page.locator("#stages .done").count(), 6);
  const ventricle = await page.locator("#facts div", { hasText: "right lateral ventricle" }).locator("dd").textContent();
  assert.ok(Number.parseFloat(ventricle) > 5, ventricle);
}

/** Takes the target a little aside; where it is then. */
async function movePath(page, shot) {
  const box = await page.locator("#axial").boundingBox();
  await page.mouse.click(box.x + box.width / 2 + 5, box.y + box.height / 2 - 5);
  const target = await page.evaluate(() => window.monro.stage.crosshair.toArray());
  await page.getByRole("button", { name: "Target to the crosshair" }).click();
  const there = (t) => window.monro && window.monro.stage.tissue.header.plan.target_lps_mm.every((v, i) => Math.abs(v - t[i]) < 1e-3);
  await page.waitForFunction(there, target, { timeout: LONG_MS });
  await page.waitForFunction(() => !document.querySelector("#open").disabled);
  await page.waitForTimeout(1000);
  await shot(page, "prepared");
  return target;
}
