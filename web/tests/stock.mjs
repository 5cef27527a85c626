// The stock as the page makes it, without a browser: node stock.mjs VIEW.bin SECONDS...
// Prints a line of JSON for each second: corners and facets of the surface, and the values of the nodes.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import ts from "typescript";

const source = join(dirname(fileURLToPath(import.meta.url)), "..", "src");
const module_ = async (name, ...replaced) => {
  let text = readFileSync(join(source, name), "utf8");
  for (const [from, to] of replaced) text = text.replace(from, to);
  const { outputText } = ts.transpileModule(text, { compilerOptions: { target: "ES2022", module: "ESNext", verbatimModuleSyntax: true } });
  return `data:text/javascript;base64,${Buffer.from(outputText).toString("base64")}`;
};
const field = await module_("scene/distance-field.ts");
const { noNet, surface } = await import(field);
const { StockStates } = await import(await module_("scene/stock-states.ts", ['"./distance-field"', JSON.stringify(field)]));
const { readView } = await import(await module_("shared/view-file.ts"));

const [file, ...seconds] = process.argv.slice(2);
const ways = new Map();
let head = null;
let states = null;
await readView(new Blob([readFileSync(file)]).stream(), (h) => (head = h), (entry, t) => {
  if (entry.kind === "field") states = new StockStates(entry, t);
  if (entry.kind === "path") ways.set(entry.step, t);
});
states.follow(head.steps.flatMap((s, i) => {
  const t = ways.get(i);
  const tool = head.tools.find((x) => x.number === s.tool);
  if (!t || !tool) return [];
  return [{
    place: Float32Array.from(t.place, (v, n) => head.low_mm[n % 3] + v * head.path_grid_mm), time: Float32Array.from(t.time, (v) => v / 1000),
    kind: Uint8Array.from(t.kind), axis: t.axis ? Float32Array.from(t.axis, (v) => v / head.axis_unit) : null, fixed: s.axis ?? [0, 0, 1], tool,
  }];
}));
let net = noNet();
for (const second of seconds) {
  states.time(Number(second));
  net = surface(states.grid, states.values, states.part, net);
  console.log(JSON.stringify({
    place: [...net.place.subarray(0, 3 * net.vertices)], normal: [...net.normal.subarray(0, 3 * net.vertices)],
    spare: [...net.spare.subarray(0, net.vertices)], index: [...net.index.subarray(0, 3 * net.triangles)], values: [...states.values],
  }));
}
