// Snapshots over the WebSocket: one is asked for, the newest comes, it is drawn, the next is asked for. One that waits long
// to be drawn is replaced by a newer one, and so is one that has waited long for this page.

import type { Api } from "./api";
import { decode, LOST_MS, type Snapshot } from "./snapshot";

const RETRY_MS = 500;
/** A snapshot that has not been drawn for this long is old: a newer one is asked for. */
const FRESH_MS = 30;
/** The watch looks this often; a question unanswered for so many looks means that the server has fallen silent. A page too
 *  busy to look does not count as silence of the server. */
const LOOK_MS = 100;
const PATIENCE = LOST_MS / LOOK_MS;
/** After so many looks another connection takes the place of one on a link that was broken without a word: it may never end by
 *  itself. A server that is only slow has answered by then. */
const BROKEN = 30;
/** By how much two clocks may drift apart. */
const DRIFT = 1e-4;

/** When, on this page's clock, the server took a snapshot. Its clock is behind ours by a constant that the quickest message
 *  tells best: what others took longer, they waited on the way. */
class Clocks {
  #behind = Infinity;
  #last = 0;

  here(serverS: number, now: number): number {
    this.#behind = Math.min(now - 1000 * serverS, this.#behind + DRIFT * (now - this.#last));
    this.#last = now;
    return 1000 * serverS + this.#behind;
  }
}

export class Stream {
  readonly #api: Api;
  readonly #onSnapshot: (snapshot: Snapshot) => void;
  readonly #onSilence: (ms: number) => void;
  readonly #onGone: (error: unknown) => void;
  #socket: WebSocket | undefined;
  /** What is asked for: nodes, or whole surfaces for a display that cannot move them. */
  readonly #word: "next" | "vertices";
  #clocks = new Clocks();
  #asked = false;
  #again = false;
  #looks = 0;

  /** `onSilence` is told for how long nothing has come, `onGone` when that is too long or the connection has ended. */
  constructor(api: Api, whole: boolean, onSnapshot: (snapshot: Snapshot) => void, onSilence: (ms: number) => void, onGone: (error: unknown) => void) {
    this.#api = api;
    this.#word = whole ? "vertices" : "next";
    this.#onSnapshot = onSnapshot;
    [this.#onSilence, this.#onGone] = [onSilence, onGone];
    void this.#connect();
    setInterval(() => this.#look(), LOOK_MS);
  }

  /** Asks for the next one; call it when the last has been drawn. */
  next(): void {
    if (this.#asked || this.#socket?.readyState !== WebSocket.OPEN) return;
    this.#socket.send(this.#word);
    [this.#asked, this.#looks] = [true, 0];
  }

  #look(): void {
    if (!this.#asked) return;
    const silent = (): Error => new Error("The server has fallen silent.");
    if (++this.#looks < PATIENCE) this.#onSilence(LOOK_MS * this.#looks);
    else if (this.#looks === PATIENCE) this.#onGone(silent());
    else if (this.#looks >= BROKEN) this.#drop(silent());
  }

  /** Hears no more of the connection, whatever still comes of it, and connects anew. */
  #drop(error: Error): void {
    const socket = this.#socket;
    if (socket) socket.onopen = socket.onmessage = socket.onclose = null;
    socket?.close();
    [this.#socket, this.#asked] = [undefined, false];
    this.#retry(error);
  }

  #take(data: ArrayBuffer): void {
    this.#asked = false;
    const snapshot = decode(data);
    const now = performance.now();
    snapshot.at = this.#clocks.here(snapshot.guidance.time_s, now);
    this.#onSnapshot(snapshot);
    // It came while this page was busy: there is a newer one. Asked for once, for this one may be all that a slow page draws.
    this.#again = !this.#again && now - snapshot.at > FRESH_MS;
    if (this.#again) this.next();
    else setTimeout(() => this.next(), FRESH_MS);
  }

  async #connect(): Promise<void> {
    try {
      const socket = await this.#api.socket("/live");
      socket.binaryType = "arraybuffer";
      socket.onopen = () => {
        this.#asked = this.#again = false;
        // A server that was started anew has another clock.
        this.#clocks = new Clocks();
        this.next();
      };
      socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.#take(event.data);
      socket.onclose = () => this.#drop(new Error("The connection to the server is lost."));
      this.#socket = socket;
    } catch (error) {
      this.#retry(error);
    }
  }

  #retry(error: unknown): void {
    this.#onGone(error);
    setTimeout(() => void this.#connect(), RETRY_MS);
  }
}
