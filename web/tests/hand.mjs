// A hand calibrates the catheter before the tracker: it holds still, pivots, turns.

import assert from "node:assert/strict";

/** `held` is the server with the hand: `tell` it what to do. */
export async function calibrate(p, held, { until, text, shot }) {
  const button = (name) => p.getByRole("button", { name, exact: true });
  const said = () => text(p, "#calibrate-said");
  await button("Calibrate").click();
  await until("the first motion", () => button("Pivot about the tip").isEnabled());
  assert.ok(!(await button("Turn about the axis").isEnabled()) && !(await button("Accept calibration").isEnabled()));
  // Held still, nothing tells the tip.
  await button("Pivot about the tip").click();
  await until("a refusal", async () => /tilted by 0\.\d degrees.*swing it in a cone/.test(await said()));
  await shot(p, "calibrate-refused");
  held.tell("pivot");
  await button("Pivot about the tip").click();
  await until("the tip", async () => /Found/.test(await said()));
  held.tell("turn");
  await button("Turn about the axis").click();
  await until("the axis", async () => (await held.api("/api/calibration")).axis !== null);
  await until("the axis on the page", () => button("Accept calibration").isEnabled());
  await shot(p, "calibrate");
  const { tip, axis } = await held.api("/api/calibration");
  // The hand's own: tip 20 mm below the body, trembling by 0.1 mm.
  assert.ok(Math.hypot(tip.tip_mm[0], tip.tip_mm[1], tip.tip_mm[2] + 20) < 0.1, JSON.stringify(tip));
  assert.ok(tip.residual_mm > 0.02 && tip.residual_mm < 0.2 && tip.tilt_deg > 10, JSON.stringify(tip));
  assert.ok(axis.axis[2] < -0.999, JSON.stringify(axis));
  assert.match(await text(p, "#calibrate-facts"), new RegExp(`${tip.residual_mm.toFixed(2)} mm`));
  await button("Accept calibration").click();
  await until("a calibrated session", async () => (await held.api("/api/guidance")).phase === "calibrated");
}
