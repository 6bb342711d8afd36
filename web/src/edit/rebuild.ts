// What becomes of the labels: the case built again from them, or a file.

import type { Api } from "../api";
import { element } from "../dom";
import type { Rebuilding } from "./desk";

const LOOK_MS = 250;

export class Rebuilder {
  readonly #api: Api;
  readonly #say: (text: string) => void;
  readonly #button = element<HTMLButtonElement>("#rebuild");

  constructor(api: Api, say: (text: string) => void) {
    [this.#api, this.#say] = [api, say];
    this.#button.onclick = () => void this.#start();
  }

  /** Goes on showing a rebuilding that was begun before the page was loaded. */
  async resume(): Promise<void> {
    if ((await this.#api.json<Rebuilding>("/api/rebuild")).state === "running") await this.#follow();
  }

  async #start(): Promise<void> {
    this.#button.disabled = true;
    try {
      await this.#api.json("/api/rebuild", "POST");
    } catch (error) {
      this.#say(String(error));
      this.#button.disabled = false;
      return;
    }
    await this.#follow();
  }

  /** Shows how far it is, until it ends. */
  async #follow(): Promise<void> {
    this.#button.disabled = true;
    try {
      for (;;) {
        const now = await this.#api.json<Rebuilding>("/api/rebuild");
        element("#progress").textContent = progress(now);
        // At the end of a panel that a low window cuts off.
        element("#progress").scrollIntoView({ block: "nearest" });
        if (now.state !== "running") break;
        await new Promise((r) => setTimeout(r, LOOK_MS));
      }
    } catch (error) {
      this.#say(String(error));
    }
    this.#button.disabled = false;
  }
}

function progress(now: Rebuilding): string {
  switch (now.state) {
    case "running": return `Rebuilding: ${now.stage ?? ""} (${(now.seconds ?? 0).toFixed(0)} s)`;
    case "done": return `Case ${now.case ?? ""} rebuilt in ${(now.seconds ?? 0).toFixed(1)} s; ${now.findings?.length ?? 0} remarks, see its report.${now.edited_since ? " ⚠ What was edited meanwhile is not in it: rebuild again." : ""}`;
    case "failed": return `Not rebuilt: ${now.error ?? "unknown reason"}`;
    default: return "";
  }
}

/** Saves the labels in the chosen format. */
export async function exportLabels(api: Api): Promise<void> {
  const format = element<HTMLSelectElement>("#format").value;
  const bytes = await api.bytes(`/api/export?format=${format}`);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([bytes]));
  link.download = `labels.${{ nifti: "nii.gz", dicom: "dcm" }[format] ?? format}`;
  link.click();
  URL.revokeObjectURL(link.href);
}
