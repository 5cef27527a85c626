// What the drivers of the page share: a browser, and what is looked for on every page.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { chromium } from "playwright-core";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
export const complaints = [];

/** A browser at an address' host; what its console and its requests should not say goes to the complaints. */
export async function open(url, width, height, { dark = false, before = () => {} } = {}) {
  const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"],
  });
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: dark ? "dark" : "light", reducedMotion: "reduce", hasTouch: width < 500 });
  await context.addInitScript(before);
  const page = await context.newPage();
  page.setDefaultTimeout(90_000);
  const origin = new URL(url).origin;
  page.on("console", (m) => {
    // what a software renderer says of its own speed is no error of the page
    if (["error", "warning"].includes(m.type()) && !/GPU stall|software WebGL|SwiftShader/i.test(m.text())) complaints.push(`console: ${m.text()}`);
  });
  page.on("pageerror", (e) => complaints.push(`error: ${e.message}`));
  page.on("request", (r) => {
    if (!r.url().startsWith(origin) && !r.url().startsWith("blob:") && !r.url().startsWith("data:")) complaints.push(`request to another host: ${r.url()}`);
  });
  return { browser, page };
}

export async function accessible(page, where) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  for (const v of violations)
    if (["serious", "critical"].includes(v.impact)) complaints.push(`axe, ${where}: ${v.id}: ${v.help}: ${v.nodes.slice(0, 3).map((n) => n.html.slice(0, 160)).join(" | ")}`);
  return violations.map((v) => `${v.id} (${v.impact})`);
}

export async function fits(page, width) {
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  if (wide > width) complaints.push(`the page is ${wide} px wide on a screen of ${width}`);
}

export const ready = (page) => page.waitForFunction(() => window.zonemill !== undefined);
/** A number that tells pictures apart. */
export const picture = (page) => page.evaluate(() => {
  window.zonemill.picture.timed();
  const gl = document.querySelector(".stage canvas").getContext("webgl2");
  const data = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, data);
  return data.reduce((h, v) => (Math.imul(h, 31) + v) | 0, 7);
});

/** Runs a driver, and prints what it says or what was wrong. */
export async function verdict(driver) {
  try {
    const said = await driver();
    assert.deepEqual(complaints, []);
    console.log(JSON.stringify(said));
  } catch (error) {
    console.error(String(error.stack ?? error));
    if (complaints.length) console.error(complaints.join("\n"));
    process.exit(1);
  }
}
