// Snapshots over the WebSocket: one is asked for, the newest comes, it is drawn, the next is asked for.

import type { Api } from "./api";
import { decode, type Snapshot } from "./snapshot";

const RETRY_MS = 500;

export class Stream {
  readonly #api: Api;
  readonly #onSnapshot: (snapshot: Snapshot) => void;
  readonly #onGone: (error: unknown) => void;
  #socket: WebSocket | undefined;

  constructor(api: Api, onSnapshot: (snapshot: Snapshot) => void, onGone: (error: unknown) => void) {
    this.#api = api;
    this.#onSnapshot = onSnapshot;
    this.#onGone = onGone;
    void this.#connect();
  }

  /** Asks for the next one; call it when the last has been drawn. */
  next(): void {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send("next");
  }

  async #connect(): Promise<void> {
    try {
      const url = new URL("/live", location.href);
      url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
      url.hash = "";
      url.searchParams.set("ticket", await this.#api.ticket());
      const socket = new WebSocket(url);
      socket.binaryType = "arraybuffer";
      socket.onopen = () => this.next();
      socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.#onSnapshot(decode(event.data));
      socket.onclose = () => this.#again(new Error("The connection to the server is lost."));
      this.#socket = socket;
    } catch (error) {
      this.#again(error);
    }
  }

  #again(error: unknown): void {
    this.#onGone(error);
    setTimeout(() => void this.#connect(), RETRY_MS);
  }
}
