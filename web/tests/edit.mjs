// The editor of labels in a real browser: the mouse draws on the canvas, the case is rebuilt, nothing is lost by a kill.
//   node tests/edit.mjs MONRO [SCAN]   MONRO is the command; without a scan, the built-in phantom; screenshots in $SHOTS

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { launch } from "./chromium.mjs";
import { PATIENCE_MS, until } from "./wait.mjs";

const SHOTS = process.env.SHOTS;
const [monro, scanGiven] = process.argv.slice(2);
if (!monro) {
  console.error("usage: node tests/edit.mjs MONRO [SCAN]");
  process.exit(2);
}
const RIGHT = 6;
const folder = mkdtempSync(join(tmpdir(), "monro-edit-"));
const out = join(folder, "case");
let scan = scanGiven;
if (!scan) {
  execFileSync(monro, ["phantom", "--out", join(folder, "phantom")], { stdio: "ignore" });
  scan = join(folder, "phantom", "dicom");
}

let server, url, token;
async function start(path, ...more) {
  server = spawn(monro, ["edit", path, ...more, "--json"], { stdio: ["ignore", "pipe", "inherit"] });
  ({ url, token } = JSON.parse(await new Promise((resolve, reject) => {
    createInterface(server.stdout).once("line", resolve);
    server.once("exit", (code) => reject(new Error(`the server ended with ${code}`)));
  })));
}

async function kill() {
  const gone = new Promise((r) => server.once("exit", r));
  server.kill("SIGKILL");
  await gone;
}

const ask = async (path) => {
  const response = await fetch(url + path, { headers: { Authorization: `Bearer ${token}` } });
  assert.equal(response.status, 200, path);
  return response;
};
const describe = async () => (await ask("/api/desk")).json();
const labels = async (axis, index) => new Uint8Array(await (await ask(`/api/slice?axis=${axis}&index=${index}&labels=true`)).arrayBuffer());

const browser = await launch();
let p;
async function openPage() {
  await p?.close();
  p = await browser.newPage({ viewport: { width: 1400, height: 900 } });
  p.setDefaultTimeout(PATIENCE_MS);
  p.faults = [];
  p.on("console", (m) => ["error", "warning"].includes(m.type()) && p.faults.push(m.text()));
  p.on("pageerror", (e) => p.faults.push(String(e)));
  // A page that was closed may still tell of its own.
  const [asked, heard] = [(p.asked = []), (p.heard = [])];
  p.on("websocket", (socket) => {
    socket.on("framesent", ({ payload }) => asked.push(JSON.parse(payload)));
    socket.on("framereceived", ({ payload }) => heard.push(JSON.parse(payload)));
  });
  await p.goto(`${url}/#token=${token}`);
  await p.locator("body[data-ready=yes]").waitFor();
}

const shot = async (name) => SHOTS && p.screenshot({ path: `${SHOTS}/${name}.png` });
const steps = () => p.evaluate(() => Number(document.body.dataset.steps));
const ml = async (label) => Number.parseFloat(await p.locator(`#ml-${label}`).textContent());

/** Where a pixel of the axial view is on the screen; mirrors web/src/edit/pane.ts, without zoom. */
async function screen([x, y], view) {
  const box = await p.locator("#axial").evaluate((e) => {
    const r = e.getBoundingClientRect();
    return { x: r.x + e.clientLeft, y: r.y + e.clientTop, width: e.clientWidth, height: e.clientHeight };
  });
  const [w, h] = view.size.map((n, i) => n * view.spacing_mm[i]);
  const [wide, high] = view.transpose ? [h, w] : [w, h];
  const scale = Math.min(box.width / wide, box.height / high);
  const offset = [0, 1].map((i) => (([x, y][i] - (view.size[i] - 1) / 2) * view.spacing_mm[i]));
  const [u, v] = view.transpose ? [offset[1], offset[0]] : offset;
  return [box.x + box.width / 2 + (view.flip[0] ? -u : u) * scale, box.y + box.height / 2 + (view.flip[1] ? -v : v) * scale];
}

/** The largest part of a label on a slice, as pixels. */
function largestPart(slice, wide, label) {
  const seen = new Set();
  let best = [];
  for (let n = 0; n < slice.length; n++) {
    if (slice[n] !== label || seen.has(n)) continue;
    const part = [n];
    seen.add(n);
    for (const m of part) {
      for (const q of [m - 1, m + 1, m - wide, m + wide]) {
        if (slice[q] === label && !seen.has(q)) {
          seen.add(q);
          part.push(q);
        }
      }
    }
    if (part.length > best.length) best = part;
  }
  return best.map((n) => [n % wide, Math.floor(n / wide)]);
}

function dice(a, b, label) {
  let [both, each] = [0, 0];
  for (let n = 0; n < a.length; n++) {
    both += Number(a[n] === label && b[n] === label);
    each += Number(a[n] === label) + Number(b[n] === label);
  }
  return (2 * both) / each;
}

/** Confidence by label in tenths of a percent: JSON may lose the last bit. */
const percent = (about) => about.confidence.map((c) => c && Math.round(1000 * c));

const S = {};
const tests = {
  async "the scan opens with its labels, in three directions"() {
    await start(scan, "--out", out);
    await openPage();
    S.about = await describe();
    S.view = S.about.views.find((v) => v.name === "axial");
    // The slice on which the right ventricle is largest.
    let most = 0;
    for (let k = 0; k < S.view.slices; k++) {
      const slice = await labels(S.view.axis, k);
      const count = slice.reduce((sum, l) => sum + Number(l === RIGHT), 0);
      if (count > most) [most, S.index, S.truth] = [count, k, slice];
    }
    assert.ok(most > 50, `${most} pixels of ventricle`);
    await p.locator("#axial").focus();
    const middle = Math.floor(S.view.slices / 2);
    const up = S.view.ascending ? S.index > middle : S.index < middle;
    for (let n = 0; n < Math.abs(S.index - middle); n++) await p.keyboard.press(up ? "PageUp" : "PageDown");
    await until("the slice", async () => (await p.locator("#axial output").textContent()).includes(` ${S.index + 1} /`));
    S.ml = await ml(RIGHT);
    // What is known of the automatic segmentation, and nothing of fluid around the brain.
    assert.match(await p.locator(`#sure-${RIGHT}`).textContent(), /^(8|9)\d %$/);
    assert.equal(await p.locator("#sure-3").textContent(), "–");
    S.sure = percent(S.about);
    await shot("edit-opened");
  },

  async "the eraser spoils a ventricle and the volume says so"() {
    const part = largestPart(S.truth, S.view.size[0], RIGHT);
    S.part = part;
    const middle = [0, 1].map((i) => part.reduce((sum, q) => sum + q[i], 0) / part.length);
    await p.keyboard.press("e");
    await p.locator("#radius").fill("12");
    const at = await screen(middle, S.view);
    await p.mouse.move(...at);
    await p.mouse.down();
    await p.mouse.move(at[0] + 15, at[1] + 25, { steps: 5 });
    await p.mouse.move(at[0] - 10, at[1] - 20, { steps: 5 });
    await p.mouse.up();
    await until("a smaller ventricle", async () => (await steps()) === 1);
    S.spoilt = await labels(S.view.axis, S.index);
    assert.ok(dice(S.spoilt, S.truth, RIGHT) < 0.8, "most of the slice is erased");
    await shot("edit-erased");
  },

  async "a livewire of clicks around it brings it back"() {
    await p.keyboard.press("w");
    await p.locator("#mode").selectOption("add");
    // Clicks at the outermost pixels of eight directions, in order around the middle.
    const middle = [0, 1].map((i) => S.part.reduce((sum, q) => sum + q[i], 0) / S.part.length);
    const clicks = [...Array(8).keys()].map((n) => {
      const [c, s] = [Math.cos((n * Math.PI) / 4), Math.sin((n * Math.PI) / 4)];
      const far = (q) => (q[0] - middle[0]) * c + (q[1] - middle[1]) * s;
      return S.part.reduce((best, q) => (far(q) > far(best) ? q : best));
    }).filter((q, n, all) => n === 0 || q.join() !== all[n - 1].join());
    for (const [n, q] of clicks.entries()) {
      const at = await screen(q, S.view);
      await p.mouse.move(at[0] - 2, at[1] + 1);
      await p.mouse.move(...at);
      await until("the wire's answer", async () => (await p.evaluate(() => document.body.dataset.hoverMs)) !== undefined);
      await p.mouse.click(...at);
      await until("the anchor", async () => ((await describe()).wire?.anchors.length ?? 0) >= 1);
      if (n === 4) {
        await p.waitForTimeout(200);
        await shot("edit-wire");
      }
    }
    await p.keyboard.press("Enter");
    await until("the contour", async () => (await steps()) === 2);
    const now = await labels(S.view.axis, S.index);
    const got = dice(now, S.truth, RIGHT);
    console.log(`      Dice of the redrawn slice ${got.toFixed(3)} with ${clicks.length} clicks`);
    assert.ok(got > 0.85 && got > dice(S.spoilt, S.truth, RIGHT), `${got}`);
    S.drawn = now;
    await shot("edit-closed");
  },

  async "a window chosen beside another tool leaves the wire as it was set"() {
    const told = () => p.asked.filter(({ op }) => op === "wire_options").at(-1);
    await p.locator("#snap").fill("9");
    await p.locator("#cooling").check();
    await p.keyboard.press("b");
    await p.locator("#radius").waitFor();
    await p.getByRole("button", { name: "Bone", exact: true }).click();
    await until("the window", async () => told().window[1] === 1500);
    assert.deepEqual([told().snap_radius, told().cooling, told().training], [9, true, true]);
    await p.getByRole("button", { name: "Brain", exact: true }).click();
    await p.keyboard.press("w");
    await p.locator("#snap").fill("4");
    await p.locator("#cooling").uncheck();
    await until("the wire as it was", async () => told().snap_radius === 4 && !told().cooling && told().window[1] === 80);
  },

  async "undo, redo and a preview change and keep what they say"() {
    await p.keyboard.press("Control+z");
    await until("one step", async () => (await steps()) === 1);
    assert.deepEqual(await labels(S.view.axis, S.index), S.spoilt);
    await p.keyboard.press("Control+y");
    await until("two steps", async () => (await steps()) === 2);
    assert.deepEqual(await labels(S.view.axis, S.index), S.drawn);
    await p.keyboard.press("s");
    await p.getByRole("button", { name: "Preview" }).click();
    await until("a preview", async () => /ml; Apply/.test(await p.locator("#message").textContent()));
    assert.equal(await steps(), 2);
    await shot("edit-preview");
    await p.keyboard.press("Escape");
    await until("no preview", async () => !(await labels(S.view.axis, S.index)).some((l) => l & 128));
    // A brush stroke on top, so that the last thing before the kill is half a second old.
    await p.keyboard.press("b");
    const at = await screen(S.part[0], S.view);
    await p.mouse.move(...at);
    await p.mouse.down();
    await p.mouse.move(at[0] + 8, at[1], { steps: 2 });
    await p.mouse.up();
    await until("three steps", async () => (await steps()) === 3);
    S.last = await labels(S.view.axis, S.index);
    ({ volumes_ml: S.volumes, drawn: S.slices } = (await describe()).state);
    assert.ok(S.slices.some((d) => d.label === RIGHT && d.slices.includes(S.index)), JSON.stringify(S.slices));
    assert.deepEqual(p.faults, []);
  },

  async "a wire on another slice is shown before it is closed"() {
    await p.keyboard.press("w");
    for (const q of [S.part[0], S.part[Math.floor(S.part.length / 2)], S.part.at(-1)]) {
      const at = await screen(q, S.view);
      await p.mouse.move(...at);
      await p.mouse.click(...at);
    }
    await until("a wire", async () => (await describe()).wire !== null);
    await p.mouse.wheel(0, 100);
    // The wheel may be heard after the key: then Enter closes the wire on its own slice.
    await until("another slice", async () => !(await p.locator("#axial output").textContent()).includes(` ${S.index + 1} /`));
    await p.keyboard.press("Enter");
    await until("the way to it", async () => /open wire is on this slice/.test(await p.locator("#message").textContent()));
    assert.equal(await steps(), 3);
    assert.notEqual((await describe()).wire, null);
    await p.keyboard.press("Escape");
    await until("no wire", async () => (await describe()).wire === null);
    assert.deepEqual(await labels(S.view.axis, S.index), S.last);
  },

  async "a second page shows what the first has changed"() {
    const first = p;
    p = undefined;
    await openPage();
    await p.keyboard.press("Control+z");
    await until("undone here", async () => (await steps()) === 2);
    await until("undone there", async () => (await first.evaluate(() => document.body.dataset.steps)) === "2");
    await first.keyboard.press("Control+y");
    await until("redone here", async () => (await steps()) === 3);
    // A wire is drawn there and given up here.
    const told = () => p.heard.filter(({ id }) => id === 0).at(-1);
    const at = await screen(S.part[0], S.view);
    await first.mouse.move(...at);
    await first.mouse.click(...at);
    await until("the wire here", async () => told()?.wire?.anchors.length === 1);
    await p.keyboard.press("Escape");
    await until("no wire", async () => (await describe()).wire === null);
    await p.close();
    p = first;
    assert.deepEqual(await labels(S.view.axis, S.index), S.last);
    assert.deepEqual(p.faults, []);
  },

  async "a killed server and a killed browser lose nothing"() {
    await kill();
    await start(scan, "--out", out);
    await openPage();
    const now = await describe();
    assert.ok(now.findings.some((f) => /restored/.test(f)), now.findings.join("; "));
    assert.deepEqual(now.state.volumes_ml, S.volumes);
    // The slices drawn by hand too, so that the space between them can be filled.
    assert.deepEqual(now.state.drawn, S.slices);
    assert.deepEqual(percent(now), S.sure);
    assert.deepEqual(await labels(S.view.axis, S.index), S.last);
    await p.locator("#undo").click();
    await until("undone", async () => (await steps()) === 2);
    assert.deepEqual(await labels(S.view.axis, S.index), S.drawn);
  },

  async "the labels are exported and the case is rebuilt"() {
    const [download] = await Promise.all([p.waitForEvent("download"), p.locator("#export").click()]);
    assert.ok(statSync(await download.path()).size > 1000);
    await p.locator("#rebuild").click();
    await until("the case", async () => /rebuilt in|Not rebuilt/.test(await p.locator("#progress").textContent()), 240);
    assert.match(await p.locator("#progress").textContent(), /rebuilt in/);
    assert.ok(existsSync(join(out, "case.toml")) && existsSync(join(out, "report.html")));
    await shot("edit-rebuilt");
    const wanted = (await describe()).state.volumes_ml;
    assert.deepEqual(p.faults, []);
    await kill();
    // The rebuilt case opens with the same labels and the same history.
    await start(out);
    const now = await describe();
    // NIfTI keeps the placement in single precision.
    now.state.volumes_ml.forEach((ml, n) => assert.ok(Math.abs(ml - wanted[n]) <= 1e-5 * wanted[n], `label ${n}: ${ml} ml`));
    assert.equal(now.state.past, 2);
    assert.deepEqual(percent(now), S.sure);
    assert.match(readFileSync(join(out, "case.toml"), "utf8"), /structure = "right_lateral_ventricle"\nexpected_dice = 0\.[89]/);
  },
};

let failed = 0;
for (const [name, test] of Object.entries(tests)) {
  try {
    await test();
    console.log(`ok    ${name}`);
  } catch (error) {
    failed++;
    console.log(`FAIL  ${name}\n${error.stack}`);
    if (p) await shot("edit-failed").catch(() => undefined);
    break;
  }
}
await browser.close();
server?.kill("SIGKILL");
rmSync(folder, { recursive: true, force: true });
console.log(failed ? "failed" : `${Object.keys(tests).length} passed`);
process.exit(failed ? 1 : 0);
