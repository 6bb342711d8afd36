// The tools and their numbers. What they do is decided by the server's desk.

export type ToolName = "wire" | "brush" | "eraser" | "threshold" | "grow" | "islands" | "holes" | "smooth" | "margin" | "combine";

type Field =
  | { kind: "number"; id: string; label: string; value: number; min: number; max: number; step: number }
  | { kind: "check"; id: string; label: string; value: boolean }
  | { kind: "choice"; id: string; label: string; options: [string, string][] }
  | { kind: "label"; id: string; label: string }
  | { kind: "button"; id: string; label: string };

interface Tool {
  name: ToolName;
  title: string;
  key: string;
  hint: string;
  fields: Field[];
}

/** What is drawn on some slices of a direction goes on to those between. */
const BETWEEN: Field[] = [
  { kind: "check", id: "interpolate", label: "Between slices", value: false },
  { kind: "button", id: "fill-between", label: "Fill between drawn slices" },
];

const PREVIEW: Field[] = [
  { kind: "button", id: "preview", label: "Preview" },
  { kind: "button", id: "apply", label: "Apply" },
];

export const TOOLS: Tool[] = [
  {
    name: "wire", title: "Livewire", key: "w",
    hint: "Click along the edge; click the first point, double-click or press Enter to close.",
    fields: [
      { kind: "choice", id: "mode", label: "Inside", options: [["replace", "is the label here"], ["add", "is added"], ["erase", "is taken away"]] },
      { kind: "number", id: "snap", label: "Snap px", value: 4, min: 0, max: 20, step: 1 },
      { kind: "check", id: "training", label: "Learns the edge from what was drawn", value: true },
      { kind: "check", id: "cooling", label: "Fixes the wire where it rests", value: false },
      ...BETWEEN,
    ],
  },
  {
    name: "brush", title: "Brush", key: "b", hint: "Drag to paint; [ and ] change the size.",
    fields: [
      { kind: "number", id: "radius", label: "Radius mm", value: 4, min: 0.2, max: 40, step: 0.2 },
      { kind: "check", id: "ball", label: "3D", value: false },
      ...BETWEEN,
    ],
  },
  {
    name: "eraser", title: "Eraser", key: "e", hint: "Drag to erase the label; [ and ] change the size.",
    fields: [
      { kind: "number", id: "radius", label: "Radius mm", value: 4, min: 0.2, max: 40, step: 0.2 },
      { kind: "check", id: "ball", label: "3D", value: false },
      ...BETWEEN,
    ],
  },
  { name: "threshold", title: "Threshold", key: "t", hint: "All voxels of the values below, as far as the limits allow.", fields: PREVIEW },
  {
    name: "grow", title: "Grow", key: "g", hint: "Click a seed. Narrow passages are not entered; too large a region is a leak.",
    fields: [
      { kind: "number", id: "neck", label: "Neck mm", value: 2, min: 0, max: 20, step: 0.5 },
      { kind: "number", id: "most", label: "At most ml", value: 60, min: 0.1, max: 2000, step: 1 },
      { kind: "button", id: "apply", label: "Apply" },
    ],
  },
  {
    name: "islands", title: "Islands", key: "i", hint: "Parts that do not touch.",
    fields: [
      { kind: "choice", id: "island", label: "", options: [["largest_island", "keep the largest"], ["small_islands", "remove below"], ["split", "others become"]] },
      { kind: "number", id: "least", label: "ml", value: 0.5, min: 0, max: 100, step: 0.1 },
      { kind: "label", id: "into", label: "label" },
      ...PREVIEW,
    ],
  },
  {
    name: "holes", title: "Holes", key: "h", hint: "Fills what is enclosed.",
    fields: [{ kind: "choice", id: "within", label: "", options: [["space", "in space"], ["0", "on slices of the current pane"]] }, ...PREVIEW],
  },
  {
    name: "smooth", title: "Smooth", key: "s", hint: "Smooths the border; the volume stays.",
    fields: [{ kind: "number", id: "sigma", label: "Width mm", value: 1, min: 0.1, max: 10, step: 0.1 }, ...PREVIEW],
  },
  {
    name: "margin", title: "Margin", key: "m", hint: "Grows the border, or shrinks it with a negative number.",
    fields: [{ kind: "number", id: "mm", label: "mm", value: 1, min: -20, max: 20, step: 0.5 }, ...PREVIEW],
  },
  {
    name: "combine", title: "Combine", key: "c", hint: "With another label, grown by a margin first.",
    fields: [
      { kind: "choice", id: "operation", label: "", options: [["union", "union"], ["intersection", "intersection"], ["difference", "difference"], ["symmetric_difference", "exclusive or"]] },
      { kind: "label", id: "with", label: "with" },
      { kind: "number", id: "grown", label: "grown by mm", value: 0, min: 0, max: 20, step: 0.5 },
      ...PREVIEW,
    ],
  },
];

/** Fields by their names; those of one name are the same in every tool. */
const FIELDS = new Map(TOOLS.flatMap((t) => t.fields).map((f) => [f.id, f]));

export interface Numbers {
  number(id: string): number;
  checked(id: string): boolean;
  choice(id: string): string;
}

/** What the server is asked for a preview; `null` for tools that need a click first. */
export function request(name: ToolName, n: Numbers, range: [number, number], axis: number): object | null {
  switch (name) {
    case "threshold": return { name, range };
    case "islands": {
      const which = n.choice("island");
      if (which === "small_islands") return { name: which, least_ml: n.number("least") };
      return which === "split" ? { name: which, into: Number(n.choice("into")) } : { name: which };
    }
    case "holes": return { name: "fill_holes", axis: n.choice("within") === "space" ? null : axis };
    case "smooth": return { name, sigma_mm: n.number("sigma") };
    case "margin": return { name, mm: n.number("mm") };
    case "combine": return { name, operation: n.choice("operation"), with: Number(n.choice("with")), margin_mm: n.number("grown") };
    default: return null;
  }
}

/** The inputs of the chosen tool. */
export class Options implements Numbers {
  readonly #box: HTMLElement;
  readonly #labels: [string, string][];
  readonly #changed: (id: string) => void;
  /** Numbers stay as they were set, also across tools. */
  readonly #values = new Map<string, string | boolean>();

  constructor(box: HTMLElement, labels: [string, string][], changed: (id: string) => void) {
    [this.#box, this.#labels, this.#changed] = [box, labels, changed];
  }

  show(tool: Tool): void {
    const hint = document.createElement("small");
    hint.textContent = tool.hint;
    this.#box.replaceChildren(hint, ...tool.fields.map((f) => this.#field(f)));
  }

  #field(field: Field): HTMLElement {
    if (field.kind === "button") {
      const button = document.createElement("button");
      [button.id, button.textContent] = [field.id, field.label];
      button.onclick = () => this.#changed(field.id);
      return button;
    }
    const label = document.createElement("label");
    const input = field.kind === "choice" || field.kind === "label" ? this.#select(field) : this.#input(field);
    input.id = field.id;
    input.onchange = () => {
      this.#values.set(field.id, input instanceof HTMLInputElement && input.type === "checkbox" ? input.checked : input.value);
      this.#changed(field.id);
    };
    label.append(...(field.kind === "check" ? [input, ` ${field.label}`] : [`${field.label} `, input]));
    return label;
  }

  #select(field: { id: string; label: string; kind: string; options?: [string, string][] }): HTMLSelectElement {
    const select = document.createElement("select");
    select.setAttribute("aria-label", field.label || field.id);
    for (const [value, text] of field.options ?? this.#labels) select.add(new Option(text, value));
    const kept = this.#values.get(field.id);
    if (typeof kept === "string") select.value = kept;
    return select;
  }

  #input(field: Extract<Field, { kind: "number" | "check" }>): HTMLInputElement {
    const input = document.createElement("input");
    const kept = this.#kept(field.id);
    if (field.kind === "check") {
      input.type = "checkbox";
      input.checked = kept === true;
    } else {
      input.type = "number";
      [input.min, input.max, input.step] = [field.min, field.max, field.step].map(String) as [string, string, string];
      input.value = String(kept);
    }
    return input;
  }

  #element<T extends HTMLElement>(id: string): T | null {
    return this.#box.querySelector<T>(`#${id}`);
  }

  /** What a number or a box was set to, also while its tool is not chosen. */
  #kept(id: string): string | boolean | number | undefined {
    const field = FIELDS.get(id);
    return this.#values.get(id) ?? (field && "value" in field ? field.value : undefined);
  }

  number(id: string): number {
    return Number(this.#element<HTMLInputElement>(id)?.value ?? this.#kept(id) ?? 0);
  }

  checked(id: string): boolean {
    return this.#element<HTMLInputElement>(id)?.checked ?? this.#kept(id) === true;
  }

  choice(id: string): string {
    return this.#element<HTMLSelectElement>(id)?.value ?? "";
  }

  /** Ticks a box, as a click does. */
  check(id: string): void {
    this.#values.set(id, true);
    const input = this.#element<HTMLInputElement>(id);
    if (input) input.checked = true;
  }

  /** Changes a number by a factor, as a key does. */
  scale(id: string, by: number): void {
    const input = this.#element<HTMLInputElement>(id);
    if (!input) return;
    input.value = String(Math.min(Number(input.max), Math.max(Number(input.min), Math.round(Number(input.value) * by * 10) / 10)));
    input.dispatchEvent(new Event("change"));
  }
}
