// The numbers as a picture, for glasses. Live, stale and lost differ in colour, shape and text; numbers vanish when lost.

import type { Guidance } from "../api";
import { element } from "../dom";
import { isRegistered, warning } from "../panel";
import { SHAPES, STATE_COLOURS, WORDS } from "../state";
import type { Anchor } from "./anchor";

const HELD_MS = 500;
/** Letters of a warning that can be read in one row. */
const ROW = 44;

const number = (v: number | null | undefined, unit: string): string => (v === null || v === undefined ? "–" : `${v.toFixed(1)}${unit}`);

function placement(anchor: Anchor, age: number | null, registered: boolean): string {
  if (anchor.placing) return `Placing: hold your head still ${(100 * anchor.dwelled).toFixed(0)} %`;
  if (anchor.kind === "manual") return "Placed by hand: not registered to the patient";
  if (!registered) return "Not registered: touch the landmarks and accept first";
  if (age === null) return "Glasses not tracked: no place known";
  return age > HELD_MS ? `Glasses lost for ${(age / 1000).toFixed(0)} s: place held` : "Placed by the tracker";
}

/** What is long in two rows: in one it would be squeezed until nobody can read it. */
function rows(line: string): string[] {
  const cut = line.length > ROW ? line.indexOf(" ", line.length / 2) : -1;
  return cut < 0 ? [line] : [line.slice(0, cut), line.slice(cut + 1)];
}

/** What is known of the catheter, and what is wrong though poses come. */
interface Known {
  guidance: Guidance | null;
  trouble: string;
}

/** Draws the sheet unless it would be the same as `before`; returns what it says. */
export function sheet(canvas: HTMLCanvasElement, { guidance: g, trouble }: Known, anchor: Anchor, age: number | null, before: string): string {
  const state = g?.state ?? "lost";
  const warned = g === null ? "" : warning(g, trouble);
  const lines = [
    number(g?.distance_to_target_mm, " mm"), `rigid ${number(g?.distance_to_target_rigid_mm, " mm")}`,
    `angle ${number(g?.entry_angle_error_deg, "°")}`, `depth ${number(g?.depth_mm, " mm")}`, warned ? `⚠ ${warned}` : placement(anchor, age, g === null || isRegistered(g)),
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
  rows(lines[4]!).forEach((row, i, { length }) => text(row, 356 + 26 * i - 13 * (length - 1), 24, warned ? STATE_COLOURS.lost : "#f0e442", warned ? 700 : 400));
  text(lines[5]!, 394, 26, "#ffffff");
  text(lines[6]!, 430, 28, "#f0e442", 700);
  return said;
}
