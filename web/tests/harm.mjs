// Treats the page badly, as networks, phones, old links and odd files do. Called by tests/e2e/test_page_harm.py:
//   node harm.mjs folder URL SHOTS      a proved job with a program
//   node harm.mjs service URL SETUP.json [SETUP.json ...]      a service without jobs; each setup goes through the form
// Prints one line of JSON; exits with 1 and says why where something is not as it should be.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { accessible, complaints, fits, open, picture, ready, verdict } from "./browser.mjs";

const [what, url, ...rest] = process.argv.slice(2);
const forgive = (pattern) => complaints.splice(0, complaints.length, ...complaints.filter((c) => !pattern.test(c)));
const pose = (page) => page.evaluate(() => window.zonemill.picture.pose);

async function folder() {
  const stem = (name) => join(rest[0], `${name}.png`);
  const said = {};

  // a phone with the bars of its browser, upright and lying, with the tool and the lines of the program shown
  for (const [width, height] of [[390, 664], [844, 390]]) {
    const { browser, page } = await open(url, width, height);
    await page.goto(`${url}#t=20`);
    await ready(page);
    await page.locator(".program").waitFor();
    await fits(page, width);
    const [stage, pinned] = await page.evaluate(() => [".stage", ".left"].map((c) => document.querySelector(c).getBoundingClientRect().height));
    assert(stage >= 200, `the picture is ${stage} px high on a screen of ${width} by ${height}`);
    if (width < 500) assert(pinned <= 0.72 * height, `${pinned} of ${height} px never scroll away, and leave nothing for the lists`);
    await page.screenshot({ path: stem(`phone-${width}`) });
    said[width] = [Math.round(stage), Math.round(pinned)];
    await browser.close();
  }

  const { browser, page } = await open(url, 1280, 800, { before: () => {
    Object.defineProperty(navigator, "clipboard", { value: undefined });
    const replace = history.replaceState.bind(history);
    window.replaced = 0;
    history.replaceState = (...all) => (window.replaced++, replace(...all));
  } });
  await page.goto(url);
  await ready(page);

  // a link that is pasted where the job is open already
  const look = "#c=60,-10,40,8,6,2&m=walls&t=12.5&s=0,0.4,1&p=1";
  await page.evaluate((l) => (location.hash = l), look);
  await page.waitForFunction(() => document.querySelector(".clock").textContent.startsWith("0:13 of") || document.querySelector(".clock").textContent.startsWith("0:12 of"));
  assert.deepEqual(await pose(page), [60, -10, 40, 8, 6, 2]);
  assert(await page.isChecked("#mode-walls") && await page.isChecked("#sflip") && await page.isChecked("#step-1") && !(await page.isChecked("#step-0")));
  assert.equal(await page.locator("#saxis").evaluate((s) => s.value), "0");
  await page.evaluate(() => (location.hash = "#c=50,-10,40,8,6,2&m=zones"));
  await page.waitForFunction(() => document.querySelector(".clock").textContent.includes("Total"));
  assert.equal(await page.locator("#saxis").evaluate((s) => s.value), "");
  // from inside the target nothing is seen, and the skip link is no look
  await page.evaluate(() => (location.hash = "#c=1,1,1,1,1,1&m=zones"));
  await page.waitForTimeout(100);
  assert.deepEqual(await pose(page), [50, -10, 40, 8, 6, 2]);

  // what is under the pointer is what is seen there: stock while there is some, and the plane where the section cuts
  const seen = async (hash) => {
    await page.evaluate((l) => (location.hash = l), hash);
    await page.waitForTimeout(300);
    return page.evaluate(() => {
      const box = document.querySelector(".stage canvas").getBoundingClientRect();
      const out = [];
      const gl = document.querySelector(".stage canvas").getContext("webgl2");
      window.zonemill.frame();
      const rgba = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
      gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
      for (let i = 0; i < 40; i++) for (let j = 0; j < 30; j++) {
        const [x, y] = [(i + 0.5) / 40, (j + 0.5) / 30];
        const hit = window.zonemill.picture.pick(box.left + box.width * x, box.top + box.height * y);
        const at = 4 * (Math.floor((1 - y) * gl.drawingBufferHeight) * gl.drawingBufferWidth + Math.floor(x * gl.drawingBufferWidth));
        if (hit) out.push({ ...hit, point: hit.point.toArray(), red: rgba[at], blue: rgba[at + 2] });
      }
      return out;
    });
  };
  const from = "#c=20,-25,25,8,6,2&m=zones";
  const whole_ = await seen(from);
  assert(whole_.length > 40 && whole_.every((h) => !h.cut && h.spare === null && h.face > 0));
  const stocked = await seen(`${from}&t=3`);
  assert(stocked.filter((h) => h.spare > 0.1).length > 20 && stocked.some((h) => h.point[2] > 4.3), "the blank stands 0.5 mm over the part, and is not met");
  const cut = (await seen(`${from}&s=1,0.5,1`)).filter((h) => h.cut);
  const both = await seen(`${from}&t=3&s=1,0.5,1`);
  const cutStock = both.filter((h) => h.cut && h.spare !== null);
  assert(cutStock.length >= 5 && both.some((h) => h.cut && h.spare === null), "part and blank are cut");
  assert(cutStock.filter((h) => h.red > h.blue + 20).length >= 0.8 * cutStock.length, "the cut face of the blank is not drawn in its colour");
  assert(both.every((h) => h.cut || h.spare !== null), "the part is seen through the blank");
  assert(cut.length > 20 && cut.every((h) => Math.abs(h.point[1] - 6) < 1e-3), "a cut face lies in the plane of the section");

  // by keys alone: what is under the cross, and a distance of two such places
  await seen(from);
  await page.locator("canvas").focus();
  for (const key of ["f", "7", "Enter"]) await page.keyboard.press(key);
  assert(await page.locator(".aim").isVisible());
  assert.match(await page.locator(".status").textContent(), /^Face F\d+ .* X 8\.0\d Y 6\.0\d Z/);
  for (const key of ["m", "Enter", "Shift+ArrowRight", "Shift+ArrowRight", "Enter"]) await page.keyboard.press(key);
  const distance = /Distance ([\d.]+) mm: X ([-\d.]+), Y ([-\d.]+)/.exec(await page.locator(".status").textContent());
  assert(distance && Math.abs(Number(distance[2])) > 0.5 && Math.abs(Number(distance[3])) < 0.05, await page.locator(".status").textContent());
  await page.keyboard.press("Escape");

  // at any second the tool is on the line of the program that is told
  const text = (await (await fetch(url.replace(/\/view$/, "/files/program.linuxcnc.ngc"))).text()).split("\n");
  const ends = [[NaN, NaN, NaN]]; // behind each line
  for (const line of text) {
    const words = line.replace(/\(.*?\)/g, "");
    assert(!/G0?[23]\b/.test(words), "this looks at straight lines only");
    ends.push(ends.at(-1).map((v, c) => Number(new RegExp(`${"XYZ"[c]}(-?[\\d.]+)`).exec(words)?.[1] ?? v)));
  }
  said.lines = 0;
  for (let t = 5; t < 140; t += 2.3) {
    await page.getByLabel("Machining time").evaluate((s, v) => {
      s.value = String(v);
      s.dispatchEvent(new Event("input", { bubbles: true }));
    }, Math.round(10 * t));
    const [, x, y, z, line] = /X (\S+) Y (\S+) Z (\S+) · line (\d+)/.exec(await page.locator(".clock").textContent()).map(Number);
    const [a, b, p] = [ends[line - 1], ends[line], [x, y, z]];
    const way = b.map((v, c) => v - a[c]);
    const share = Math.min(1, Math.max(0, way.reduce((sum, v, c) => sum + v * (p[c] - a[c]), 0) / Math.max(1e-12, way.reduce((sum, v) => sum + v * v, 0))));
    const off = Math.hypot(...way.map((v, c) => a[c] + share * v - p[c]));
    assert(off < 0.01, `at ${t} s the tool is ${off} mm from line ${line}, ${text[line - 1]}`);
    said.lines++;
  }

  // browsers stop a page that writes the address at every frame
  const [writes, ms] = await page.getByLabel("Machining time").evaluate(async (slider) => {
    const from = performance.now();
    window.replaced = 0;
    for (let k = 0; k < 60; k++) {
      slider.value = String(10 * k);
      slider.dispatchEvent(new Event("input", { bubbles: true }));
      await new Promise((resume) => setTimeout(resume, 20));
    }
    return [window.replaced, performance.now() - from];
  });
  said.writes = writes;
  assert(writes >= 1 && writes <= ms / 500 + 1, `the address was written ${writes} times in ${ms} ms`);
  await page.getByLabel("Playback speed").selectOption("10");
  await page.locator(".play").click();
  await page.waitForTimeout(1000);
  await page.locator(".play").click();

  // over http, or where it is forbidden, there is no clipboard
  await page.locator("summary", { hasText: "Share and keys" }).click();
  await page.getByRole("button", { name: "Copy link" }).click();
  await page.getByText("Copy the address of this page instead").waitFor();

  // a phone takes the card away and gives it back
  await page.waitForFunction(() => window.zonemill.picture.resolution === 1);
  const before = await picture(page);
  await page.evaluate(() => new Promise((done) => {
    const canvas = document.querySelector(".stage canvas");
    const lose = canvas.getContext("webgl2").getExtension("WEBGL_lose_context");
    canvas.addEventListener("webglcontextrestored", () => {
      // only what the page does by itself counts
      window.drawn = 0;
      const of = window.zonemill.picture;
      const draw = of.onDraw;
      of.onDraw = () => (window.drawn++, draw());
      setTimeout(done, 500);
    });
    lose.loseContext();
    setTimeout(() => lose.restoreContext(), 200);
  }));
  assert(await page.evaluate(() => window.drawn) >= 1, "nothing is drawn after the card came back");
  assert.equal(await picture(page), before);
  forgive(/Context Lost|Context Restored|CONTEXT_LOST/i);
  await browser.close();

  // a file that is none, one cut off, one that holds less than it says; and a browser that draws nothing in 3D
  const whole = new Uint8Array(await (await fetch(url.replace(/\/view$/, "/files/view.bin"))).arrayBuffer());
  const length = new DataView(whole.buffer).getUint32(8, true);
  const bad = whole.slice();
  bad.fill(0x55, 12 + length, 12 + length + 400);
  const long = whole.slice(0, 4000);
  new DataView(long.buffer).setUint32(8, 0xfffffff0, true);
  for (const [name, bytes, words] of [["none", new TextEncoder().encode("<!doctype html>".repeat(9)), /unknown format/], ["cut", whole.slice(0, whole.length - 100), /incomplete/],
    ["long", long, /incomplete/], ["bad", bad, /damaged/], ["no-webgl", whole, /WebGL/]]) {
    const { browser, page } = await open(url, 390, 664, { before: name === "no-webgl" ? () => {
      HTMLCanvasElement.prototype.getContext = () => null;
    } : undefined });
    await page.route("**/files/view.bin", (route) => route.fulfill({ body: Buffer.from(bytes), contentType: "application/octet-stream" }));
    await page.goto(url);
    await page.getByText("The 3D view cannot be shown").waitFor();
    const told = await page.locator(".refusal").textContent();
    assert(words.test(told), `${name}: ${told}`);
    await page.getByRole("button", { name: "report.json" }).waitFor();
    await page.waitForFunction(() => [...document.images].length === 2 && [...document.images].every((i) => i.naturalWidth > 100));
    await fits(page, 390);
    await accessible(page, name);
    await page.screenshot({ path: stem(`flat-${name}`) });
    forgive(/WebGL/);
    await browser.close();
  }
  return said;
}

async function service() {
  // a browser that keeps nothing for anybody shows the page all the same
  const { browser: poor, page: bare } = await open(url, 390, 664, { before: () => {
    for (const shelf of ["localStorage", "sessionStorage"]) Object.defineProperty(window, shelf, { get: () => {
      throw new DOMException("denied", "SecurityError");
    } });
  } });
  const LONG = "W".repeat(200); // as long as a label may be
  await bare.route("**/v1/jobs?*", (route) => route.fulfill({ json: { items: [{ id: "j2", kind: "plan", state: "failed", stage: "", progress: 0, labels: { order: LONG }, created_at: "2026-01-01T00:00:00Z",
    error: { title: "", detail: LONG }, links: {} }], next_cursor: null } }));
  await bare.goto(url);
  await bare.getByRole("button", { name: "Use dark colours" }).click();
  await bare.locator(".jobrow").waitFor();
  await fits(bare, 390);
  await poor.close();

  const { browser, page } = await open(url, 1280, 800);
  const said = { setups: [] };
  await page.goto(url);
  await page.waitForSelector(".newjob");

  // a setup comes out of the form as it went in, whatever the one before had
  await page.locator("summary", { hasText: "Setup as file or text" }).click();
  for (const file of rest) {
    await page.setInputFiles("#setupfile", file);
    await page.getByText("is loaded").waitFor();
    const got = JSON.parse(await page.locator("#json").inputValue());
    for (const [key, value] of Object.entries(JSON.parse(readFileSync(file, "utf8"))))
      if (typeof value === "object" && !Array.isArray(value)) for (const [k, v] of Object.entries(value)) assert.deepEqual(got[key][k], v, `${file}: ${key}.${k}`);
      else assert.deepEqual(got[key], value, `${file}: ${key}`);
    said.setups.push(got);
    await page.getByText("is loaded").evaluate((p) => p.remove());
  }
  await accessible(page, "form");

  // who has keys alone does not lose the place in the table of tools
  const focused = () => page.evaluate(() => document.activeElement.getAttribute("aria-label") ?? document.activeElement.textContent);
  await page.getByRole("button", { name: "Add a copy of the last tool" }).focus();
  await page.keyboard.press("Enter");
  assert.equal(await focused(), "T number, tool 2");
  await page.getByLabel("Remove tool 2").focus();
  await page.keyboard.press("Enter");
  assert.equal(await focused(), "Remove tool 1");

  // a stream of events that breaks, and a service that is away for a while
  const job = (state) => ({ id: "j1", kind: "plan", state, stage: "zones", progress: 0.1, labels: { order: "<img src=x onerror=alert(1)>" }, created_at: "2026-01-01T00:00:00Z",
    error: state === "failed" ? { title: "Out of <b>time</b>", detail: "it took too long" } : null, links: { self: "/v1/jobs/j1", events: "/v1/jobs/j1/events" } });
  let asked = 0;
  let state = "running";
  await page.route("**/v1/jobs/j1", (route) => route.fulfill({ json: job(state) }));
  await page.route("**/v1/jobs/j1/events", (route) => {
    asked++;
    if (asked === 1) return route.fulfill({ body: `event: progress\ndata: ${JSON.stringify({ stage: "paths", progress: 0.42 })}\nid: 7\n\n`, contentType: "text/event-stream" });
    if (asked === 2) return route.abort("connectionreset");
    if (asked === 3) return route.fulfill({ status: 503, body: "" });
    state = "failed";
    return route.fulfill({ body: `event: end\ndata: ${JSON.stringify({ stage: "done", progress: 1 })}\n\n`, contentType: "text/event-stream" });
  });
  await page.goto(new URL("/v1/jobs/j1/view", url).href);
  await page.getByText("42 %, paths").waitFor();
  await page.getByText("reconnects by itself").waitFor();
  await page.getByText("it took too long").waitFor();
  assert.equal(asked, 4);
  // names are words, whatever stands in them
  assert.equal(await page.locator(".title").evaluate((t) => t.firstChild.textContent), "<img src=x onerror=alert(1)>");
  assert.equal(await page.locator("main img, main b, header img").count(), 0);
  forgive(/ERR_CONNECTION_RESET|503/);

  // an address that is none
  await page.goto(new URL("/v1/jobs/%E0%A4%A/view", url).href);
  await page.locator(".refusal").waitFor();
  forgive(/404|400/);

  // a key with what no header takes, as it comes out of a message, and then another
  await page.route("**/v1/jobs?*", (route) => route.fulfill({ status: 401, json: { title: "No key", status: 401, detail: "send a key" } }));
  await page.goto(url);
  await page.fill("#key", "zm_\u200bab");
  await page.getByRole("button", { name: "Use key" }).click();
  await page.getByText("Copy it again").waitFor();
  assert.equal(await page.evaluate(() => sessionStorage.length), 0);
  await page.fill("#key", "zm_ab");
  await page.getByRole("button", { name: "Use key" }).click();
  await page.waitForFunction(() => sessionStorage.length === 1);
  forgive(/401/);

  // what was written into the form stays while a key is given, and a key that may not submit is told so
  let status = 401;
  await page.unroute("**/v1/jobs?*");
  await page.route("**/v1/jobs?*", (route) => (status === 401 ? route.fulfill({ status, json: { title: "No key", status, detail: "send a key" } }) : route.continue()));
  await page.route("**/v1/jobs", (route) => route.fulfill({ status, json: { title: "Refused", status, detail: "this key may not submit", measured: ["read"], remedy: "ask for more" } }));
  await page.goto(url);
  await page.setInputFiles("#part", { name: "p.step", mimeType: "model/step", buffer: Buffer.from("ISO-10303-21;") });
  await page.fill("#order", "4711");
  await page.locator("button.main", { hasText: "Plan and prove" }).click();
  await page.getByText("Enter the key under Jobs").waitFor();
  status = 403;
  await page.fill("#key", "zm_cd");
  await page.getByRole("button", { name: "Use key" }).click();
  await page.getByText("There are no jobs yet").waitFor();
  assert.equal(await page.inputValue("#order"), "4711");
  assert.equal(await page.evaluate(() => document.getElementById("part").files.length), 1);
  await page.locator("button.main", { hasText: "Plan and prove" }).click();
  await page.getByText("this key may not submit").waitFor();
  assert(await page.locator("button.main", { hasText: "Plan and prove" }).isEnabled());
  // a link to a job of another key
  await page.goto(new URL("/v1/jobs/none/view", url).href);
  await page.getByRole("button", { name: "Use another key" }).click();
  await page.locator("#key").waitFor();
  forgive(/40[134]/);
  await browser.close();
  return said;
}

await verdict({ folder, service }[what]);
