// A tracker of its own, as a program that can be killed.

import assert from "node:assert/strict";

const PORT = 28944;

/** `monro(args)` starts the command; `start` as in demo.mjs; `folder` is a case. */
export async function killedTracker(monro, start, open, folder, { until, text, number, shot }) {
  const camera = () => monro(["fake-tracker", "openigtlink", "--listen", `127.0.0.1:${PORT}`]);
  let tracker = camera();
  const { url, token, api, child } = await start(["serve", folder, "--json", "--no-igtl", "--no-record", "--listen", "127.0.0.1:0", "--tracker", `igtl://127.0.0.1:${PORT}`]);
  try {
    // Any calibration will do: what matters is whether there are numbers.
    await api("/api/session", { event: "calibrated", tip_mm: [0, 0, 0], axis: [0, 0, -1] });
    await api("/api/session", { event: "registered", quaternion_wxyz: [1, 0, 0, 0], translation_mm: [0, 0, 0], predicted_tre_mm: 1 });
    for (const event of ["check_passed", "started"]) await api("/api/session", { event });
    const p = await open(`${url}/#token=${token}`);
    const shows = (word) => until(word, async () => (await text(p, "#signal span")) === word);
    const numbers = ["#n-rigid", "#n-angle", "#n-offset", "#n-depth"];
    await shows("Live");
    await until("numbers", async () => Number.isFinite(await number(p, "#n-rigid")));
    await frozenIsSaid(p, until, text);
    tracker.kill("SIGKILL");
    await shows("Lost");
    for (const id of [...numbers, "#n-distance", "#n-miss", "#n-ventricle", "#n-tre"]) assert.equal(await text(p, id), "–", id);
    assert.equal((await api("/api/guidance")).state, "lost");
    assert.match((await api("/api/status")).tracker_diagnosis, /\S/);
    // Why, in the server's words, on the page too.
    const { tracker_diagnosis: why } = await api("/api/status");
    await until("why it is lost", async () => (await text(p, "#why")).includes(why.slice(0, 20)));
    await shot(p, "tracker-killed");
    tracker = camera();
    await shows("Live");
    for (const id of numbers) await until(`${id} again`, async () => Number.isFinite(await number(p, id)));
    assert.deepEqual(p.faults, []);
  } finally {
    child.kill();
    tracker.kill("SIGKILL");
  }
}

/** From now on the page hears that poses are frozen, until `honest`. */
export function pretendFrozen(p) {
  return p.evaluate(() => {
    const honest = window.fetch;
    window.fetch = async (...of) => {
      const answer = await honest(...of);
      if (!String(of[0]).endsWith("/api/status")) return answer;
      return new Response(JSON.stringify({ ...(await answer.json()), tracker_trouble: "Poses do not change: 'Catheter' has not moved to the last digit." }));
    };
    window.honest = honest;
  });
}

/** The page hears again what the server says. */
export const honest = (p) => p.evaluate(() => void (window.fetch = window.honest));

/** A tool that does not move at all is told while its poses come: then the numbers look sound. */
async function frozenIsSaid(p, until, text) {
  await pretendFrozen(p);
  await until("it is frozen", async () => /Poses do not change: 'Catheter'/.test(await text(p, "#alarm")));
  // On a busy machine a pose may be late for a moment.
  await until("it is live all the same", async () => (await text(p, "#signal span")) === "Live");
  await honest(p);
  await until("it is not any more", async () => (await text(p, "#alarm")) === "");
}
