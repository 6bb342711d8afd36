// How many frames a second the live page draws, and what each stage costs it, while a scripted insertion runs.
//   node tests/fps.mjs MONRO CASE [SECONDS]     one line of JSON; GPU=1 uses the graphics card instead of the processor

import { spawn } from "node:child_process";
import { createInterface } from "node:readline";
import { launch } from "./chromium.mjs";

const [monro, folder, seconds = "10"] = process.argv.slice(2);
const SIZE = { width: 1920, height: 1080 };

const server = spawn(monro, ["serve", folder, "--json", "--no-igtl", "--no-record", "--listen", "127.0.0.1:0"], { stdio: ["ignore", "pipe", "inherit"] });
const browser = await launch(process.env.GPU === "1");
try {
  const line = await new Promise((resolve, reject) => {
    createInterface(server.stdout).once("line", resolve);
    server.once("exit", (code) => reject(new Error(`the server ended with ${code}`)));
  });
  const { url, token } = JSON.parse(line);
  const page = await browser.newPage({ viewport: SIZE });
  await page.goto(`${url}/#token=${token}`);
  await page.waitForFunction(() => document.querySelector("#signal span")?.textContent === "Live", null, { timeout: 120_000 });
  const measured = await page.evaluate(async (ms) => {
    const gl = window.monro.stage.renderer.getContext();
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    const { stage } = window.monro;
    const [times, work] = [[], []];
    // What the page itself does for a frame; what the GPU does later is in the rate.
    const draw = stage.draw.bind(stage);
    stage.draw = () => {
      const start = performance.now();
      const drawn = draw();
      if (drawn) {
        work.push(performance.now() - start);
        times.push(start);
      }
      return drawn;
    };
    await new Promise((r) => setTimeout(r, ms));
    delete stage.draw;
    const gaps = times.slice(1).map((t, i) => t - times[i]).sort((a, b) => a - b);
    const at = (sorted, q) => sorted[Math.min(sorted.length - 1, Math.floor(q * sorted.length))] ?? null;
    work.sort((a, b) => a - b);
    return {
      renderer: info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER),
      vertices: stage.tissue.surfaces.reduce((n, s) => n + s.mesh.geometry.attributes.position.count, 0),
      frames_per_s: (1000 * (times.length - 1)) / (times[times.length - 1] - times[0]),
      frame_p50_ms: at(gaps, 0.5), frame_p99_ms: at(gaps, 0.99), draw_p50_ms: at(work, 0.5), draw_p99_ms: at(work, 0.99),
    };
  }, 1000 * Number(seconds));
  console.log(JSON.stringify({ ...measured, window: [SIZE.width, SIZE.height] }));
} finally {
  await browser.close();
  server.kill();
}
