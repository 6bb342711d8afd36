// Buttons and check boxes.

import { element, make } from "./dom";
import { WINDOWS } from "./view/ct";
import { MOVED_SCALE_MM } from "./view/world";
import type { Stage } from "./view/stage";
import type { SurfaceName } from "./view/surfaces";

type WindowName = keyof typeof WINDOWS;

/** Which panes are shown; the names stand in style.css too. */
const LAYOUTS = { guide: "Guide", slices: "Slices", all: "All", calibrate: "Calibrate", register: "Register" } as const;
/** Pane that fills the window, when one does. */
const ALONE = "alone";

function checkbox(parent: HTMLElement, text: string, checked: boolean, onChange: (on: boolean) => void): HTMLInputElement {
  const box = make("input", { type: "checkbox", checked });
  box.onchange = () => onChange(box.checked);
  parent.append(make("label", {}, box, ` ${text}`));
  return box;
}

/** Buttons of which one is pressed. */
function choice<T extends string>(parent: HTMLElement, names: Record<T, string>, pressed: T, onChoose: (name: T) => void): (name: T | null) => void {
  const buttons = (Object.entries(names) as [T, string][]).map(([name, text]) => ({ name, button: make("button", { textContent: text }) }));
  const show = (chosen: T | null): void => buttons.forEach(({ name, button }) => button.setAttribute("aria-pressed", String(name === chosen)));
  for (const { name, button } of buttons) {
    button.onclick = () => {
      show(name);
      onChoose(name);
    };
  }
  parent.append(...buttons.map(({ button }) => button));
  show(pressed);
  return show;
}

export function controls(stage: Stage): void {
  layers(stage);
  ctControls(stage);
  windows(stage);
  layouts(stage);
}

export function layers(stage: Stage): void {
  const parent = element("#layers");
  // The 3D view around it would take the pointer for turning.
  parent.addEventListener("pointerdown", (e) => e.stopPropagation());
  for (const name of ["skin", "brain", "ventricles"] satisfies SurfaceName[]) {
    checkbox(parent, name, true, (on) => stage.setVisible(name, on));
  }
  const legend = make("span", { id: "legend", hidden: true, textContent: `0 – ${MOVED_SCALE_MM} mm` });
  checkbox(parent, "displacement", false, (on) => {
    stage.setColoured(on);
    legend.hidden = !on;
  });
  parent.append(legend);
}

type CtControl = "deformed" | "outlines" | "follows";

export function ctControls(stage: Stage, wanted: CtControl[] = ["deformed", "outlines", "follows"]): void {
  const parent = element("#ct");
  if (stage.whole) {
    document.body.classList.add("undeformed");
  } else if (wanted.includes("deformed")) {
    checkbox(parent, "deformed with the tissue", true, (on) => {
      stage.setDeformed(on);
      document.body.classList.toggle("undeformed", !on);
    });
  }
  if (wanted.includes("outlines")) checkbox(parent, "outlines", true, (on) => stage.setOutlines(on));
  if (!wanted.includes("follows")) return;
  const follow = checkbox(parent, "follows the tip", true, (on) => (stage.follow = on));
  stage.onFree = () => (stage.follow = follow.checked = false);
}

export function windows(stage: Stage): void {
  const parent = element("#window");
  const [level, width] = (["Level", "Width"] as const).map((name) => {
    const input = make("input", { type: "number", step: "5" });
    input.setAttribute("aria-label", `${name}, HU`);
    return input;
  }) as [HTMLInputElement, HTMLInputElement];
  width.min = "1";
  const show = choice<WindowName>(parent, { Brain: "Brain", Stroke: "Stroke", Subdural: "Subdural", Bone: "Bone" }, "Brain", set);
  function set(name: WindowName): void {
    [level.valueAsNumber, width.valueAsNumber] = WINDOWS[name];
    stage.window(level.valueAsNumber, width.valueAsNumber);
  }
  for (const input of [level, width]) {
    input.onchange = () => {
      if (!(Number.isFinite(level.valueAsNumber) && width.valueAsNumber >= 1)) return;
      stage.window(level.valueAsNumber, width.valueAsNumber);
      show(null);
    };
  }
  parent.append(make("label", {}, "L ", level), make("label", {}, "W ", width));
  set("Brain");
}

function layouts(stage: Stage): void {
  const main = element("main");
  const choose = (name: string): void => {
    main.dataset["layout"] = name;
    stage.touch();
  };
  let usual = "guide" as keyof typeof LAYOUTS;
  const show = choice<keyof typeof LAYOUTS>(element("#layout"), LAYOUTS, usual, (name) => choose((usual = name)));
  const alone = (pane: HTMLElement): void => {
    const ends = main.dataset["layout"] === ALONE;
    main.querySelectorAll(".chosen").forEach((p) => p.classList.remove("chosen"));
    pane.classList.toggle("chosen", !ends);
    choose(ends ? usual : ALONE);
    show(ends ? usual : null);
  };
  for (const pane of main.querySelectorAll<HTMLElement>(".view")) {
    pane.addEventListener("dblclick", () => alone(pane));
    pane.addEventListener("keydown", (e) => e.key === "Enter" && e.target === pane && alone(pane));
  }
}
