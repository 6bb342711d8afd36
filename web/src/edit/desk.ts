// The server's desk: small JSON messages over one WebSocket, slices over HTTP. Mirrors crates/server/src/edit.

import type { Api } from "../api";

export type Point = [number, number];

export interface View {
  name: "axial" | "coronal" | "sagittal";
  axis: number;
  slices: number;
  size: [number, number];
  spacing_mm: [number, number];
  transpose: boolean;
  flip: [boolean, boolean];
  ascending: boolean;
}

export interface State {
  past: number;
  future: number;
  volumes_ml: number[];
  drawn: { label: number; axis: number; slices: number[] }[];
}

export interface Wire {
  axis: number;
  slice: number;
  fixed: Point[];
  anchors: Point[];
}

export interface Description {
  scan: string;
  dims: [number, number, number];
  views: View[];
  labels: { label: number; name: string; colour: [number, number, number]; ventricle: boolean; intracranial: boolean }[];
  findings: string[];
  /** Expected Dice of the automatic segmentation by label, null where nothing is known. */
  confidence: (number | null)[];
  state: State;
  wire: Wire | null;
}

export interface Target {
  label: number;
  over: number[] | null;
  range: [number, number] | null;
}

export interface Answer {
  id: number | null;
  error?: string;
  state?: State;
  wire?: Wire | null;
  changed?: number;
  anchors?: number;
  snapped?: Point;
  path?: Point[];
  closes?: boolean;
  preview?: { ml: number; stopped: boolean; number: number };
}

export interface Rebuilding {
  state: "never" | "running" | "done" | "failed";
  stage?: string;
  seconds?: number;
  case?: string;
  findings?: string[];
  error?: string;
  /** Labels were edited after the rebuilding had begun: they are not in the case. */
  edited_since?: boolean;
}

const RETRY_MS = 500;

export class Desk {
  readonly #api: Api;
  readonly #waiting = new Map<number, (answer: Answer) => void>();
  readonly #onConnected: (connected: boolean) => void;
  readonly #onEdited: (told: Answer) => void;
  #socket: WebSocket | undefined;
  #next = 1;

  /** `onEdited` is told what another page has changed, of the labels and of the open wire. */
  constructor(api: Api, onConnected: (connected: boolean) => void, onEdited: (told: Answer) => void) {
    this.#api = api;
    this.#onConnected = onConnected;
    this.#onEdited = onEdited;
  }

  /** Sends one message; the answer may carry an `error` for the user. */
  ask(op: string, fields: object = {}): Promise<Answer> {
    const id = this.#next++;
    if (this.#socket?.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ id, error: "No connection to the server; nothing was changed." });
    }
    return new Promise((resolve) => {
      this.#waiting.set(id, resolve);
      this.#socket?.send(JSON.stringify({ id, op, ...fields }));
    });
  }

  async connect(): Promise<void> {
    try {
      const socket = await this.#api.socket("/desk");
      socket.onopen = () => this.#onConnected(true);
      socket.onmessage = (event: MessageEvent<string>) => {
        const answer = JSON.parse(event.data) as Answer;
        if (answer.id === null) return;
        if (answer.id === 0) return this.#onEdited(answer);
        this.#waiting.get(answer.id)?.(answer);
        this.#waiting.delete(answer.id);
      };
      socket.onclose = () => this.#gone();
      this.#socket = socket;
    } catch {
      this.#gone();
    }
  }

  #gone(): void {
    this.#onConnected(false);
    for (const [id, resolve] of this.#waiting) resolve({ id, error: "The connection to the server is lost." });
    this.#waiting.clear();
    setTimeout(() => void this.connect(), RETRY_MS);
  }

  async hu(axis: number, index: number): Promise<Int16Array> {
    return new Int16Array(await this.#api.bytes(`/api/slice?axis=${axis}&index=${index}`));
  }

  async labels(axis: number, index: number): Promise<Uint8Array> {
    return new Uint8Array(await this.#api.bytes(`/api/slice?axis=${axis}&index=${index}&labels=true`));
  }
}
