// Drives the page as a person would, and looks for what a person would complain about. Called by tests/e2e/test_page.py:
//   node drive.mjs upload URL PART.step SETUP.json SHOTS      a job from the form to the picture
//   node drive.mjs key URL KEY                                   a service that asks for a key
//   node drive.mjs library URL LIBRARY SHOTS                     tools of a library, from the dry run to the table
//   node drive.mjs look URL SHOTS WIDTH HEIGHT                  a finished job, on a screen of that size
// Prints one line of JSON; exits with 1 and says why where something is not as it should be.
import assert from "node:assert/strict";
import { join } from "node:path";
import { accessible, complaints, fits, open as opened, picture, ready, verdict } from "./browser.mjs";

const [what, url, ...rest] = process.argv.slice(2);
const open = (width, height, dark) => opened(url, width, height, { dark });
/** How many different colours a picture of the stage has: a blank one has one or two. */
const colours = (page) => page.evaluate(() => {
  window.zonemill.frame();
  const canvas = document.querySelector(".stage canvas");
  const gl = canvas.getContext("webgl2");
  const data = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  window.zonemill.picture.timed();
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, data);
  const seen = new Set();
  for (let i = 0; i < data.length; i += 4 * 37) seen.add((data[i] >> 4) * 256 + (data[i + 1] >> 4) * 16 + (data[i + 2] >> 4));
  return seen.size;
});
const figures = (page) => page.evaluate(() => ({ ...document.querySelector(".left").dataset, frame_ms: [1, 2, 3, 4, 5].map(() => Math.round(window.zonemill.frame())).sort((a, b) => a - b)[2], heap_mb: Math.round((performance.memory?.usedJSHeapSize ?? 0) / 1e6) }));

async function upload() {
  const [part, setup, shots] = rest;
  const { browser, page } = await open(1280, 800);
  await page.goto(url);
  await page.waitForSelector(".newjob");
  await accessible(page, "list");
  await page.setViewportSize({ width: 390, height: 844 });
  await fits(page, 390);
  await page.screenshot({ path: join(shots, "form-390.png"), fullPage: true });
  await page.setViewportSize({ width: 1280, height: 800 });
  await page.setInputFiles("#part", part);
  await page.setInputFiles("#setupfile", setup);
  await page.getByText("is loaded").waitFor();
  await page.fill("#order", "Step block 7");
  // the tool editor: a field that makes no sense is refused with its name, and put right
  const flutes = page.getByLabel("Flute length, mm, tool 1");
  const good = await flutes.inputValue();
  await flutes.fill("900");
  await page.click("button.main");
  await page.getByText("flute_length_mm").first().waitFor();
  complaints.splice(0, complaints.length, ...complaints.filter((c) => !c.includes("422")));
  await flutes.fill(good);
  await page.screenshot({ path: join(shots, "form.png"), fullPage: true });
  await page.click("button.main");
  await page.waitForURL(/\/v1\/jobs\/[^/]+\/view/);
  await page.waitForSelector("progress");
  const seen = new Set();
  while (!(await page.evaluate(() => window.zonemill !== undefined))) {
    const text = await page.evaluate(() => document.querySelector(".waiting [role=status]")?.textContent ?? "");
    if (text) seen.add(text);
    await page.waitForTimeout(150);
  }
  assert(seen.size >= 2, `progress was not seen to move: ${[...seen]}`);
  assert(await page.evaluate(() => document.querySelector(".badge").textContent) === "proved");
  assert(await colours(page) > 8, "nothing is drawn");
  await page.screenshot({ path: join(shots, "uploaded.png") });
  const said = await figures(page);
  // the dry check of the same part, from the same form
  await page.goto(new URL("/", url).href);
  await page.getByText("Step block 7").waitFor();
  await page.setInputFiles("#part", part);
  await page.setInputFiles("#setupfile", setup);
  await page.getByText("is loaded").waitFor();
  await page.click("button[value=dry]");
  await page.getByText("the tools reach").waitFor();
  await accessible(page, "dry check");
  await page.screenshot({ path: join(shots, "dry.png") });
  await browser.close();
  return { progress: [...seen].length, ...said };
}

async function look() {
  const [shots, width, height] = [rest[0], Number(rest[1]), Number(rest[2])];
  const { browser, page } = await open(width, height, width < 500);
  const stem = (name) => join(shots, `${name}-${width}.png`);
  await page.goto(url);
  await ready(page);
  await fits(page, width);
  assert(await colours(page) > 8, "nothing is drawn");
  await page.screenshot({ path: stem("opened") });
  // with all that can be opened, for what is closed is not looked at
  const lists = page.locator(".panel details");
  await lists.evaluateAll((all) => all.forEach((d) => (d.open = true)));
  const minor = await accessible(page, "job");
  await page.screenshot({ path: stem("lists"), fullPage: true });
  await lists.evaluateAll((all) => all.forEach((d) => (d.open = false)));
  await lists.first().evaluate((d) => (d.open = true));
  const said = await figures(page);

  const findings = page.locator(".findings button");
  let jumped = null;
  if (await findings.count()) {
    const before = await page.evaluate(() => location.hash);
    await findings.first().click();
    await page.waitForTimeout(700); // the address follows within half a second
    assert(await page.evaluate(() => location.hash) !== before, "the camera did not go to the finding");
    assert(await page.locator(".ring:not([hidden])").count() === 1, "the place of the finding is not marked");
    jumped = await page.locator(".status").textContent();
    assert(/line \d+/.test(jumped), `the line of the finding is not said: ${jumped}`);
    await page.screenshot({ path: stem("finding") });
  }
  const slider = page.getByLabel("Machining time");
  await slider.evaluate((s) => {
    s.value = String(Math.round(Number(s.max) / 2));
    s.dispatchEvent(new Event("input", { bubbles: true }));
  });
  await page.waitForTimeout(400);
  const clock = await page.locator(".clock").textContent();
  assert(/X -?[\d.]+ Y -?[\d.]+ Z -?[\d.]+/.test(clock), `the tool is nowhere: ${clock}`);
  await page.screenshot({ path: stem("middle") });
  // the stock is there, and without it something else is seen
  const withStock = await picture(page);
  await page.uncheck("#stock");
  assert.notEqual(await picture(page), withStock, "no stock is drawn");
  await page.check("#stock");

  await page.locator("summary", { hasText: "Section and measuring" }).click();
  await page.selectOption("#saxis", "1");
  await page.waitForTimeout(700);
  assert((await page.evaluate(() => location.hash)).includes("s=1,"), "the section is not in the link");
  await page.evaluate(() => window.scrollTo(0, 0));
  await page.getByRole("button", { name: "Fit the part" }).click();
  await page.waitForTimeout(700);
  await page.screenshot({ path: stem("section") });

  // the link brings the same look back
  const [link, pose] = await page.evaluate(() => [location.href, window.zonemill.picture.pose]);
  await page.goto("about:blank");
  await page.goto(link);
  await ready(page);
  assert.deepEqual(await page.evaluate(() => window.zonemill.picture.pose), pose);
  assert(await page.evaluate(() => document.getElementById("saxis").value) === "1");

  // keys: the picture has the focus, turns, changes its colours, and lets the focus go on
  await page.locator("canvas").focus();
  await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("d");
  assert.notDeepEqual(await page.evaluate(() => window.zonemill.picture.pose), pose);
  assert(await page.isChecked("#mode-deviation"));
  await page.keyboard.press("Tab");
  assert(await page.evaluate(() => document.activeElement.tagName !== "CANVAS"));

  // measuring between two places
  await page.locator("canvas").focus();
  await page.keyboard.press("Escape");
  await page.keyboard.press("f");
  await page.evaluate(() => { const s = document.getElementById("saxis"); s.value = ""; s.dispatchEvent(new Event("input", { bubbles: true })); });
  await page.keyboard.press("m");
  const places = await page.evaluate(() => {
    const box = document.querySelector(".stage canvas").getBoundingClientRect();
    const out = [];
    for (let k = 0; k < 400 && out.length < 2; k++) {
      const x = box.left + box.width * (0.2 + 0.6 * ((k * 0.618) % 1)), y = box.top + box.height * (0.25 + 0.5 * ((k * 0.382) % 1));
      if (window.zonemill.picture.pick(x, y) && document.elementFromPoint(x, y)?.tagName === "CANVAS" && (!out.length || Math.hypot(out[0][0] - x, out[0][1] - y) > 40)) out.push([x, y]);
    }
    return out;
  });
  assert(places.length === 2, "no two places of the part are seen");
  for (const [x, y] of places) await page.mouse.click(x, y);
  await page.waitForTimeout(200);
  const distance = await page.locator(".status").textContent();
  assert(/Distance \d+\.\d+ mm/.test(distance), `nothing was measured: ${distance}`);
  await browser.close();
  return { ...said, jumped, clock, distance, minor };
}

async function key() {
  const { browser, page } = await open(1280, 800);
  await page.goto(url);
  await page.getByText("needs a key").waitFor();
  await accessible(page, "key");
  await page.fill("#key", "zm_000000000000_" + "x".repeat(43));
  await page.click("button:has-text('Use key')");
  await page.waitForTimeout(500);
  await page.fill("#key", rest[0]);
  await page.click("button:has-text('Use key')");
  await page.getByText("There are no jobs yet").waitFor();
  const kept = await page.evaluate(() => ({ session: Object.keys(sessionStorage), local: JSON.stringify(localStorage), cookie: document.cookie }));
  assert(!kept.local.includes(rest[0]) && !kept.cookie && !(await page.evaluate(() => location.href)).includes(rest[0]));
  // what the browser says of the refusals that were asked for
  complaints.splice(0, complaints.length, ...complaints.filter((c) => !/401/.test(c)));
  await browser.close();
  return kept;
}

async function library() {
  const [file, shots] = rest;
  const { browser, page } = await open(1280, 800);
  await page.goto(url);
  await page.waitForSelector(".newjob");
  await page.locator("details.library summary").click();
  await page.setInputFiles("#libraryfile", file);
  await page.getByText("are they mm or inches?").waitFor();
  complaints.splice(0, complaints.length, ...complaints.filter((c) => !c.includes("422")));
  await page.selectOption("#libraryunit", "in");
  await page.getByText("left out.").waitFor();
  const minor = await accessible(page, "library");
  await page.screenshot({ path: join(shots, "library.png"), fullPage: true });
  const rows = await page.locator("details.library tbody tr").allInnerTexts();
  await page.getByRole("button", { name: "Replace the table by" }).click();
  const kinds = await page.locator(".tools select").evaluateAll((all) => all.map((s) => s.value));
  const diameter = await page.getByLabel("Diameter, mm, tool 1", { exact: true }).inputValue();
  await page.setViewportSize({ width: 390, height: 844 });
  await fits(page, 390);
  await browser.close();
  return { rows, kinds, diameter: Number(diameter), minor };
}

await verdict({ upload, look, key, library }[what]);
