// Prints what the Khronos validator says of each file, as JSON: a list of its reports.
const fs = require("fs");
const { validateBytes } = require("gltf-validator");

(async () => {
  const reports = [];
  for (const file of process.argv.slice(2)) {
    reports.push(await validateBytes(new Uint8Array(fs.readFileSync(file)), { uri: file }));
  }
  console.log(JSON.stringify(reports));
})();
