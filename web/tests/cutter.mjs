// The distance field that the page cuts, without a browser: node cutter.mjs GRID TIP AXIS TOOLS, all JSON.
// Prints for each tool the values of the nodes of a full block after its cutting part stood in it.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import ts from "typescript";

const source = join(dirname(fileURLToPath(import.meta.url)), "..", "src", "scene");
const load = async (name, ...replaced) => {
  let text = readFileSync(join(source, name), "utf8");
  for (const [from, to] of replaced) text = text.replace(from, to);
  const { outputText } = ts.transpileModule(text, { compilerOptions: { target: "ES2022", module: "ESNext", verbatimModuleSyntax: true } });
  return `data:text/javascript;base64,${Buffer.from(outputText).toString("base64")}`;
};
const field = await load("distance-field.ts");
const { sweep } = await import(field);
const { cutterOf } = await import(await load("stock-states.ts", ['"./distance-field"', JSON.stringify(field)]));
const [grid, tip, axis, tools] = process.argv.slice(2).map((text) => JSON.parse(text));
for (const tool of tools) {
  const values = new Float32Array(grid.nx * grid.ny * grid.nz).fill(grid.step * 4);
  sweep(grid, values, cutterOf(tool), tip, tip, axis, axis);
  console.log(JSON.stringify([...values]));
}
