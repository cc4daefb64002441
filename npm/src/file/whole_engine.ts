// The whole engine as a function, loaded on demand with the whole module; see small_engine.ts.

export { start as startWholeEngine } from "../engine/start.js";
