// The script of the worker that computes errors.

import { ErrorFields } from "./error_fields.js";
import type { ErrorResponse, MeshMessage, ErrorRequest } from "./messages.js";

let fields: ErrorFields;

addEventListener("message", ({ data }: MessageEvent<MeshMessage | ErrorRequest>) => {
  if ("triangles" in data) {
    fields = new ErrorFields(data.triangles, data.nVerts, data.diagonal);
    return;
  }
  const { id, kind, original, decoded } = data;
  const answer: ErrorResponse = { id, values: fields.values(kind, original, decoded) };
  postMessage(answer);
});
