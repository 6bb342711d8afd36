// A scan becomes a case in the browser, and the live session goes on at the same address.

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
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
  // In the way of the session's recording.
  const taken = join(dir, "taken.mnrs");
  writeFileSync(taken, "");
  const server = spawn(MONRO, ["serve", "--json", "--scans", join(dir, "scans"), "--out", out, "--no-igtl", "--record", taken], { stdio: ["ignore", "pipe", "ignore"] });
  try {
    const { url, token } = JSON.parse(await new Promise((resolve) => createInterface(server.stdout).once("line", resolve)));
    const page = await open(`${url}/#token=${token}`, lateAnswer);
    await prepare(page, shot);
    const planned = await movePath(page, shot);
    assert.ok(!existsSync(out), "the case is written before it was asked for");
    await failToOpen(page, taken, shot);
    assert.ok(existsSync(join(out, "case.toml")), "the case was written, although it could not be opened");
    // The labels are still the automatic ones, whatever the path.
    assert.match(readFileSync(join(out, "case.toml"), "utf8"), /\[\[confidence\]\]/);
    const second = await page.context().browser().newPage();
    await second.goto(`${url}/#token=${token}`);
    await second.waitForFunction(() => document.querySelector("#entry-side").value === "left", null, { timeout: LONG_MS });
    await page.getByRole("button", { name: "Write the case and navigate" }).click();
    // A second page follows to the live session, too.
    for (const p of [page, second]) await p.waitForFunction(() => document.querySelector("#signal span")?.textContent === "Live", null, { timeout: LONG_MS });
    await second.close();
    assert.equal(new URL(page.url()).origin, url);
    const headers = { Authorization: `Bearer ${token}` };
    const { plan } = await (await fetch(`${url}/api/case`, { headers })).json();
    assert.ok(Math.hypot(...plan.target_lps_mm.map((v, i) => v - planned[i])) < 1e-3, "the path that was moved is the path that is followed");
    const [report] = await Promise.all([page.context().waitForEvent("page"), page.getByRole("button", { name: "Report" }).click()]);
    await report.getByRole("heading", { name: "Prepared case" }).waitFor();
    assert.ok(await report.evaluate(() => getComputedStyle(document.body).maxWidth === "1320px"), "the report has its styles");
    await report.close();
    // The browser itself reports the refusal on the console.
    assert.deepEqual(page.faults.filter((f) => !/409|422/.test(f)), []);
    await shot(page, "prepared-and-live");
  } finally {
    server.kill();
    rmSync(dir, { recursive: true, force: true });
  }
}

/** What stands in the way is said, the server lives on, and once it is put right the case opens. */
async function failToOpen(page, taken, shot) {
  await page.getByRole("button", { name: "Write the case and navigate" }).click();
  await page.waitForFunction(() => /taken\.mnrs/.test(document.querySelector("#said").textContent), null, { timeout: LONG_MS });
  await shot(page, "prepared-not-opened");
  rmSync(taken);
}

/** The server's first answer comes late, as on a busy machine: nothing may be pressed before the page can do it. */
async function lateAnswer(page) {
  await page.route("**/api/prepare", async (route) => {
    await new Promise((resolve) => setTimeout(resolve, 1500));
    await route.continue();
  }, { times: 1 });
}

async function prepare(page, shot) {
  await page.locator("#entry-side").selectOption("left");
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
