// Post a part with a setup built from typed classes, wait for the end, fetch the programs:
// node dist/run-job.js PART.step OUT; ZONEMILL_BASE and ZONEMILL_KEY as for the curl scripts.
import { readFile, writeFile } from "node:fs/promises";
import { basename, join } from "node:path";
import createClient from "openapi-fetch";
import type { components, paths } from "./wire.js";

type Setup = components["schemas"]["Setup"];
type Tool = components["schemas"]["Tool"];
type Job = components["schemas"]["Job"];

const { ZONEMILL_BASE: base = "http://127.0.0.1:8000", ZONEMILL_KEY: key } = process.env;
const [part, out] = process.argv.slice(2) as [string, string];

const client = createClient<paths>({
  baseUrl: base,
  headers: key ? { Authorization: `Bearer ${key}` } : {},
});

const tool: Tool = { id: "T1", kind: "flat", diameter_mm: 4, flute_length_mm: 8, stickout_mm: 20 };
const setup: Setup = {
  tools: [tool],
  quality: { scallop_height_mm: 0.05 },
  stock: { margin_mm: 0.5, uncertainty_mm: 0 },
  labels: { client: "typescript" },
};

/** The answer, or an error that says what the service said. */
function known<T>(answer: { data?: T; error?: unknown }): T {
  if (answer.data === undefined) throw new Error(JSON.stringify(answer.error));
  return answer.data;
}

/** The multipart form: the part as a file, the setup as JSON. */
function form(step: Buffer, setup: Setup): FormData {
  const made = new FormData();
  made.append("part", new Blob([new Uint8Array(step)], { type: "model/step" }), basename(part));
  made.append("setup", new Blob([JSON.stringify(setup)], { type: "application/json" }));
  return made;
}

const step = await readFile(part);
let job: Job = known(await client.POST("/v1/jobs", {
  params: { header: { "Idempotency-Key": "client-typescript" } },
  body: { part: "", setup },
  bodySerializer: (body) => form(step, body.setup),
}));
while (job.state === "queued" || job.state === "running") {
  await new Promise((done) => setTimeout(done, 500));
  job = known(await client.GET("/v1/jobs/{job_id}", { params: { path: { job_id: job.id } } }));
}
const files = known(await client.GET("/v1/jobs/{job_id}/files", { params: { path: { job_id: job.id } } }));
const programs = files.items.filter((file) => file.name.startsWith("program."));
for (const { name } of programs) {
  const got = await client.GET("/v1/jobs/{job_id}/files/{name}", {
    params: { path: { job_id: job.id, name } }, parseAs: "arrayBuffer",
  });
  await writeFile(join(out, name), new Uint8Array(known(got) as ArrayBuffer));
}
console.log(`${job.state}, coverage ${job.summary?.coverage?.toFixed(4)}, ${programs.length} programs`);
