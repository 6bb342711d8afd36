// The keyboard of the editor, and the list of its keys.

import { element, make } from "../dom";
import { TOOLS, type ToolName } from "./tools";

/** A key, what it does in words, and that. */
export type Binding = [string, string, () => void];

/** What keys do that are no bindings of their own. */
export interface KeyActions {
  choose: (tool: ToolName) => void;
  pick: (label: number) => void;
  undo: () => void;
  redo: () => void;
}

export class Keys {
  readonly #bindings: Binding[];
  readonly #actions: KeyActions;
  readonly #labels: number;

  /** `labels` is how many there are, the outside among them. */
  constructor(bindings: Binding[], actions: KeyActions, labels: number) {
    [this.#bindings, this.#actions, this.#labels] = [[...bindings, ["?", "this list", () => this.help()]], actions, labels];
    addEventListener("keydown", (event) => this.#key(event));
  }

  #key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement;
    if (document.querySelector("dialog[open]") || (target.matches("input[type=number], select") && event.key !== "Escape")) return;
    if (target.matches("button") && event.key === "Enter") return;
    const act = event.ctrlKey || event.metaKey ? this.#history(event) : this.#plain(event.key);
    if (!act) return;
    act();
    event.preventDefault();
  }

  #history(event: KeyboardEvent): (() => void) | undefined {
    const { undo, redo } = this.#actions;
    switch (event.key.toLowerCase()) {
      case "z": return event.shiftKey ? redo : undo;
      case "y": return redo;
      default: return undefined;
    }
  }

  #plain(key: string): (() => void) | undefined {
    const tool = TOOLS.find((t) => t.key === key);
    if (tool) return () => this.#actions.choose(tool.name);
    const own = this.#bindings.find(([k]) => k === key);
    if (own) return own[2];
    const label = Number(key);
    return key !== " " && label >= 1 && label < this.#labels ? () => this.#actions.pick(label) : undefined;
  }

  /** Shows all keys. */
  help(): void {
    const rows: [string, string][] = [
      ...TOOLS.map((t): [string, string] => [t.key, t.title]),
      [`1 – ${this.#labels - 1}`, "choose the label"], ["Ctrl+Z, Ctrl+Y", "undo, redo"], ["wheel, Page Up and Down, arrows", "next slice"],
      ["Tab", "next pane, tool or number"], ["Ctrl+wheel", "zoom"], ["Alt+drag", "move the picture"],
      ...this.#bindings.map(([key, what]): [string, string] => [key, what]),
    ];
    element("#key-list").replaceChildren(...rows.flatMap(([key, what]) => {
      const dt = make("dt", {});
      dt.append(make("kbd", { textContent: key }));
      return [dt, make("dd", { textContent: what })];
    }));
    element<HTMLDialogElement>("#keys").showModal();
  }
}
