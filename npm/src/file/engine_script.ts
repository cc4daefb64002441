// The engine as a function. build.mjs bundles all dependencies into its body, so that its source text
// is a complete worker script: bundlers need no configuration, and no second file is fetched.

export { start as startEngine } from "../engine/start.js";
