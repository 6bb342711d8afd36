// The panel of the editor: tools, grey values, labels, what may change, and what was found. Built once.

import { element, make } from "../dom";
import type { Description } from "./desk";
import { TOOLS, type ToolName } from "./tools";

const WINDOWS: [string, number, number][] = [["Brain", 0, 80], ["Ventricles", -10, 50], ["Subdural", -20, 180], ["Bone", -200, 1500]];

/** What its buttons do. */
export interface Actions {
  choose: (tool: ToolName) => void;
  window: (low: number, high: number) => void;
  opacity: (value: number) => void;
  pick: (label: number) => void;
}

/** A label for people. */
export const words = (name: string): string => name.replaceAll("_", " ");

export function buildPanel(about: Description, actions: Actions): void {
  element("#patient").textContent = about.scan;
  document.title = `${about.scan} · Labels · Monro`;
  tools(actions);
  windows(actions);
  labels(about, actions);
  mayChange(about);
  const list = element("#findings ul");
  for (const finding of about.findings) list.append(make("li", { textContent: finding }));
  element("#findings").hidden = about.findings.length === 0;
}

function tools({ choose }: Actions): void {
  for (const tool of TOOLS) {
    const button = make("button", { textContent: tool.title, title: `${tool.hint} (${tool.key})`, onclick: () => choose(tool.name) });
    button.dataset["tool"] = tool.name;
    element("#tools").append(button);
  }
}

function windows({ window, opacity }: Actions): void {
  for (const [text, low, high] of WINDOWS) element("#window").append(make("button", { textContent: text, onclick: () => window(low, high) }));
  const slider = make("input", { type: "range", min: "0", max: "1", step: "0.05", value: "0.3", id: "opacity" });
  slider.setAttribute("aria-label", "Opacity of the labels");
  slider.oninput = () => opacity(Number(slider.value));
  element("#window").append(slider);
}

function labels(about: Description, { pick }: Actions): void {
  for (const { label, name, colour } of about.labels.slice(1)) {
    const swatch = make("i", {});
    swatch.style.background = `rgb(${colour.join(" ")})`;
    const button = make("button", { textContent: words(name), title: `key ${label}`, onclick: () => pick(label) });
    button.dataset["label"] = String(label);
    const expected = about.confidence[label];
    const sure = make("output", {
      id: `sure-${label}`,
      textContent: typeof expected === "number" ? `${Math.round(100 * expected)} %` : "–",
      title: "expected Dice of the automatic segmentation, before corrections",
    });
    element("#labels").append(swatch, button, make("output", { id: `ml-${label}` }), sure);
  }
}

/** What an edit may write over: what lies within the skull, to begin with. */
function mayChange(about: Description): void {
  const over = element<HTMLSelectElement>("#over");
  const within = about.labels.filter((l) => l.intracranial).map((l) => l.label).join(",");
  over.add(new Option("every label", "any"));
  over.add(new Option("CSF, brain and ventricles", within));
  for (const { label, name } of about.labels.slice(1)) over.add(new Option(`only ${words(name)}`, String(label)));
  over.value = within;
}
