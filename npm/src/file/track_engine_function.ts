// The engine of further tracks as a function, as engine_function.ts has that of the positions: a
// script of its own, which is loaded when a track is asked for.

export { start as startTrackEngine } from "../engine/start_tracks.js";
