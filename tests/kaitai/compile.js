// node compile.js SOURCE LANGUAGE FOLDER: what kaitai-struct-compiler makes of a .ksy file.
const fs = require("fs");
const path = require("path");
const yaml = require("js-yaml");
const compiler = require("kaitai-struct-compiler");

const [source, language, folder] = process.argv.slice(2);
compiler
  .compile(language, yaml.load(fs.readFileSync(source, "utf8")), null, false)
  .then((files) => {
    for (const [name, text] of Object.entries(files)) fs.writeFileSync(path.join(folder, name), text);
  })
  .catch((error) => {
    console.error(String(error));
    process.exitCode = 1;
  });
