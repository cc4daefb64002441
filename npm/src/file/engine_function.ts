// The engine as a function. build.mjs puts all that it needs inside it, so that its text is the
// script of a worker: there is no second file, and bundlers need no set-up.

export { start as startEngine } from "../engine/start.js";
