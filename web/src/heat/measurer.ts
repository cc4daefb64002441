// Errors of frames, computed in a worker.

import type { Answer, Meeting, Question } from "./messages";
import script from "./worker.ts?script";

interface Waiting {
  resolve(answer: Answer): void;
  reject(error: Error): void;
}

export class Measurer {
  private readonly worker: Worker;
  private readonly waiting = new Map<number, Waiting>();
  private nAsked = 0;

  constructor(mesh: Meeting) {
    const url = URL.createObjectURL(new Blob([script], { type: "text/javascript" }));
    this.worker = new Worker(url);
    this.worker.addEventListener("message", ({ data }: MessageEvent<Answer>) => {
      URL.revokeObjectURL(url);
      this.waiting.get(data.id)?.resolve(data);
      this.waiting.delete(data.id);
    });
    this.worker.addEventListener("error", ({ message }) => {
      const error = new Error(`The errors cannot be computed: ${message || "no worker starts"}`);
      for (const { reject } of this.waiting.values()) reject(error);
      this.waiting.clear();
    });
    this.worker.postMessage(mesh);
  }

  /** Of a frame whose positions (V, 3) are given twice; values of a heat map where one is wanted. */
  measure(kind: string | null, original: Float32Array, decoded: Float32Array): Promise<Answer> {
    const question: Question = { id: this.nAsked++, kind, original, decoded };
    return new Promise((resolve, reject) => {
      this.waiting.set(question.id, { resolve, reject });
      this.worker.postMessage(question);
    });
  }
}
