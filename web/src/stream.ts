// Snapshots over the WebSocket: one is asked for, the newest comes, it is drawn, the next is asked for. One that waits long
// to be drawn is replaced by a newer one.

import type { Api } from "./api";
import { decode, type Snapshot } from "./snapshot";

const RETRY_MS = 500;
/** A snapshot that has not been drawn for this long is old: a newer one is asked for. */
const FRESH_MS = 30;
/** The watch looks this often; a question unanswered this many looks in a row means that the server has fallen silent, as
 *  on a link that is broken without a word. A page too busy to look does not count as silence of the server. */
const LOOK_MS = 250;
const PATIENCE = 6;

export class Stream {
  readonly #api: Api;
  readonly #onSnapshot: (snapshot: Snapshot) => void;
  readonly #onGone: (error: unknown) => void;
  #socket: WebSocket | undefined;
  #asked = false;
  #looks = 0;

  constructor(api: Api, onSnapshot: (snapshot: Snapshot) => void, onGone: (error: unknown) => void) {
    this.#api = api;
    this.#onSnapshot = onSnapshot;
    this.#onGone = onGone;
    void this.#connect();
    setInterval(() => this.#look(), LOOK_MS);
  }

  /** Asks for the next one; call it when the last has been drawn. */
  next(): void {
    if (this.#asked || this.#socket?.readyState !== WebSocket.OPEN) return;
    this.#socket.send("next");
    [this.#asked, this.#looks] = [true, 0];
  }

  #look(): void {
    if (this.#asked && ++this.#looks === PATIENCE) this.#onGone(new Error("The server has fallen silent."));
  }

  #take(data: ArrayBuffer): void {
    this.#asked = false;
    this.#onSnapshot(decode(data));
    setTimeout(() => this.next(), FRESH_MS);
  }

  async #connect(): Promise<void> {
    try {
      const url = new URL("/live", location.href);
      url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
      url.hash = "";
      url.searchParams.set("ticket", await this.#api.ticket());
      const socket = new WebSocket(url);
      socket.binaryType = "arraybuffer";
      socket.onopen = () => {
        this.#asked = false;
        this.next();
      };
      socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.#take(event.data);
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
