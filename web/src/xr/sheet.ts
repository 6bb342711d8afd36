// The numbers as a picture, for glasses. Live, stale and lost differ in colour, shape and text; numbers vanish when lost.

import type { Guidance } from "../api";
import { element } from "../dom";
import { alarm, isRegistered } from "../panel";
import { SHAPES, STATE_COLOURS, WORDS } from "../state";
import type { Anchor } from "./anchor";

const HELD_MS = 500;

const number = (v: number | null | undefined, unit: string): string => (v === null || v === undefined ? "–" : `${v.toFixed(1)}${unit}`);

function placement(anchor: Anchor, age: number | null, registered: boolean): string {
  if (anchor.placing) return `Placing: hold your head still ${(100 * anchor.dwelled).toFixed(0)} %`;
  if (anchor.kind === "manual") return "Placed by hand: not registered to the patient";
  if (!registered) return "Not registered: touch the landmarks and accept first";
  if (age === null) return "Glasses not tracked: no place known";
  return age > HELD_MS ? `Glasses lost for ${(age / 1000).toFixed(0)} s: place held` : "Placed by the tracker";
}

/** Draws the sheet unless it would be the same as `before`; returns what it says. */
export function sheet(canvas: HTMLCanvasElement, g: Guidance | null, anchor: Anchor, age: number | null, before: string): string {
  const state = g?.state ?? "lost";
  const warning = g === null ? "" : alarm(g);
  const lines = [
    number(g?.distance_to_target_mm, " mm"), `rigid ${number(g?.distance_to_target_rigid_mm, " mm")}`,
    `angle ${number(g?.entry_angle_error_deg, "°")}`, `depth ${number(g?.depth_mm, " mm")}`, warning ? `⚠ ${warning}` : placement(anchor, age, g === null || isRegistered(g)),
    `${element("#patient").textContent} · ${element("#side").textContent}`, "Research use only",
  ];
  const said = [state, ...lines].join("\n");
  const context = canvas.getContext("2d");
  if (said === before || !context) return said;
  context.fillStyle = "#0b0d10";
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.fillStyle = STATE_COLOURS[state];
  context.save();
  context.translate(14, 14);
  context.scale(2, 2);
  context.fill(new Path2D(SHAPES[state]));
  context.restore();
  const text = (line: string, y: number, size: number, colour: string, weight = 400): void => {
    context.fillStyle = colour;
    context.font = `${weight} ${size}px system-ui, sans-serif`;
    context.fillText(line, 16, y, canvas.width - 32);
  };
  context.fillStyle = STATE_COLOURS[state];
  context.font = "700 44px system-ui, sans-serif";
  context.fillText(WORDS[state], 78, 54);
  text(lines[0]!, 152, 96, "#ffffff", 700);
  text(lines[1]!, 204, 38, "#c4ccd6");
  text(lines[2]!, 262, 54, "#ffffff", 700);
  text(lines[3]!, 312, 38, "#c4ccd6");
  text(lines[4]!, 356, 24, warning ? STATE_COLOURS.lost : "#f0e442", warning ? 700 : 400);
  text(lines[5]!, 394, 26, "#ffffff");
  text(lines[6]!, 430, 28, "#f0e442", 700);
  return said;
}
