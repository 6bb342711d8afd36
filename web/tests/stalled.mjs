// A display that asks for snapshots and never reads one.

import { randomBytes } from "node:crypto";
import { request } from "node:http";

/** A WebSocket text frame of a client, masked with zeros. */
const FRAME = Buffer.concat([Buffer.from([0x81, 0x80 | 4, 0, 0, 0, 0]), Buffer.from("next")]);
const REQUESTS = 2000;

/** Connects and asks; resolves to the socket, which is not read. */
export function stalledDisplay(url, ticket) {
  return new Promise((resolve, reject) => {
    const headers = {
      Connection: "Upgrade", Upgrade: "websocket", "Sec-WebSocket-Version": "13",
      "Sec-WebSocket-Key": randomBytes(16).toString("base64"),
    };
    const asked = request(`${url}/live?ticket=${ticket}`, { headers });
    asked.on("error", reject);
    asked.on("response", (r) => reject(new Error(`the stalled display was refused: ${r.statusCode}`)));
    asked.on("upgrade", (_, socket) => {
      socket.pause();
      socket.on("error", () => undefined);
      for (let i = 0; i < REQUESTS; i++) socket.write(FRAME);
      resolve(socket);
    });
    asked.end();
  });
}
