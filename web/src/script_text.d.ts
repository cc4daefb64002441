// `import text from "./name.ts?script"`: a module and what it imports, as the text of a script.
declare module "*?script" {
  const text: string;
  export default text;
}
