// A browser-like `Worker` for Node that runs the script of a blob.

import { resolveObjectURL } from "node:buffer";
import { Worker } from "node:worker_threads";

/** Globals of a browser worker. */
const GLOBALS = `
  const { parentPort } = require("node:worker_threads");
  globalThis.self = { postMessage: (message, transfer) => parentPort.postMessage(message, transfer) };
  parentPort.on("message", (data) => self.onmessage({ data }));
`;

/** Runs the script in a thread; messages are queued until it has started. */
export class PageWorker {
  onmessage = null;
  onerror = null;
  #isEnded = false;
  #thread;

  constructor(url) {
    const script = resolveObjectURL(url).text();
    this.#thread = script.then((text) => {
      if (this.#isEnded) return null;
      const thread = new Worker(GLOBALS + text, { eval: true });
      thread.on("message", (data) => this.onmessage?.({ data }));
      thread.on("error", ({ message }) => this.onerror?.({ message, preventDefault() {} }));
      return thread;
    });
  }

  postMessage(message, transfer) {
    // Transfers detach immediately, as in browsers.
    const sent = structuredClone(message.module ? {} : message, { transfer });
    const whole = message.module ? message : sent;
    this.#thread.then((thread) => thread?.postMessage(whole));
  }

  terminate() {
    this.#isEnded = true;
    this.#thread.then((thread) => thread?.terminate());
  }
}
