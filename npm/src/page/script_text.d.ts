// `import text from "./name.ts?script"`: a bundled module as the text of a script.
declare module "*?script" {
  const text: string;
  export default text;
}
