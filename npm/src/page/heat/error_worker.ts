// Client of the worker that computes errors.

import type { ErrorResponse, MeshMessage, ErrorRequest } from "./messages.js";
import script from "./worker.ts?script";

interface PendingRequest {
  resolve(answer: ErrorResponse): void;
  reject(error: Error): void;
}

/** Computes errors of frames in a worker. */
export class ErrorWorker {
  private readonly worker: Worker;
  private readonly pending = new Map<number, PendingRequest>();
  private nRequests = 0;

  constructor(mesh: MeshMessage) {
    const url = URL.createObjectURL(new Blob([script], { type: "text/javascript" }));
    this.worker = new Worker(url);
    this.worker.addEventListener("message", ({ data }: MessageEvent<ErrorResponse>) => {
      URL.revokeObjectURL(url);
      this.pending.get(data.id)?.resolve(data);
      this.pending.delete(data.id);
    });
    this.worker.addEventListener("error", ({ message }) => {
      const error = new Error(`The errors cannot be computed: ${message || "the worker does not start"}`);
      for (const { reject } of this.pending.values()) reject(error);
      this.pending.clear();
    });
    this.worker.postMessage(mesh);
  }

  /** Compute a heat map of a frame. */
  async measure(kind: string, original: Float32Array, decoded: Float32Array): Promise<Float32Array> {
    const question: ErrorRequest = { id: this.nRequests++, kind, original, decoded };
    const answer = await new Promise<ErrorResponse>((resolve, reject) => {
      this.pending.set(question.id, { resolve, reject });
      this.worker.postMessage(question);
    });
    return answer.values;
  }
}
