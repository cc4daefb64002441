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

  /** Compute the errors of a frame, and a heat map unless `kind` is null. */
  measure(kind: string | null, original: Float32Array, decoded: Float32Array): Promise<ErrorResponse> {
    const question: ErrorRequest = { id: this.nRequests++, kind, original, decoded };
    return new Promise((resolve, reject) => {
      this.pending.set(question.id, { resolve, reject });
      this.worker.postMessage(question);
    });
  }
}
