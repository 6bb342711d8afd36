// Buttons and check boxes.

import { WINDOWS } from "./view/ct";
import type { Stage } from "./view/stage";
import type { SurfaceName } from "./view/surfaces";

function fieldset(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (!found) throw new Error(`The page has no #${id}.`);
  return found;
}

function checkbox(parent: HTMLElement, text: string, checked: boolean, onChange: (on: boolean) => void): void {
  const [label, box] = [document.createElement("label"), document.createElement("input")];
  box.type = "checkbox";
  box.checked = checked;
  box.onchange = () => onChange(box.checked);
  label.append(box, ` ${text}`);
  parent.append(label);
}

export function controls(stage: Stage): void {
  const layers = fieldset("layers");
  // The 3D view around it would take the pointer for turning.
  layers.addEventListener("pointerdown", (e) => e.stopPropagation());
  for (const name of ["skin", "brain", "ventricles"] satisfies SurfaceName[]) {
    checkbox(layers, name, true, (on) => stage.setVisible(name, on));
  }
  checkbox(layers, "displacement", false, (on) => stage.setColoured(on));

  const presets = fieldset("window");
  const names = Object.keys(WINDOWS) as (keyof typeof WINDOWS)[];
  const buttons = names.map((name) => {
    const button = document.createElement("button");
    button.textContent = name;
    button.setAttribute("aria-pressed", String(name === "Brain"));
    button.onclick = () => {
      stage.window(name);
      buttons.forEach((b) => b.setAttribute("aria-pressed", String(b === button)));
    };
    return button;
  });
  presets.append(...buttons);

  const follow = fieldset("follow").querySelector("input");
  if (!follow) throw new Error("The page has no follow box.");
  follow.onchange = () => (stage.follow = follow.checked);
  stage.onFree = () => (stage.follow = follow.checked = false);
}
