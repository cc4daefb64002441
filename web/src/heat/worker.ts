// The script of the worker that computes errors.

import { HeatFields } from "./fields";
import type { Answer, Meeting, Question } from "./messages";

let fields: HeatFields;

addEventListener("message", ({ data }: MessageEvent<Meeting | Question>) => {
  if ("triangles" in data) {
    fields = new HeatFields(data.triangles, data.nVerts, data.diagonal);
    return;
  }
  const { id, kind, original, decoded } = data;
  const values = kind === null ? null : fields.of(kind, original, decoded);
  const answer: Answer = { id, values, errors: fields.errors(original, decoded) };
  postMessage(answer);
});
