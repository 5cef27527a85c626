// Opens a job in Chromium without a graphics card and prints what it costs: node measure.mjs URL
import { chromium } from "playwright-core";

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--enable-precise-memory-info"],
});
const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
await page.goto(process.argv[2]);
await page.waitForFunction(() => window.zonemill !== undefined, null, { timeout: 120_000 });
await page.waitForTimeout(1000);
const frame = () => page.evaluate(() => Array.from({ length: 7 }, () => window.zonemill.frame()).sort((a, b) => a - b)[3]);
const part = await frame();
await page.evaluate(() => {
  for (const box of document.querySelectorAll("[id^=step-]")) box.checked = true;
  document.querySelector("[id^=step-]").dispatchEvent(new Event("change", { bubbles: true }));
});
await page.waitForTimeout(500);
const all = await frame();
const moving = await page.evaluate(() => Array.from({ length: 5 }, () => window.zonemill.moving()).sort((a, b) => a - b)[2]);
const said = await page.evaluate(() => ({ ...document.querySelector(".left").dataset, heap: performance.memory.usedJSHeapSize }));
console.log(JSON.stringify({
  first_picture_s: Number(said.rough) / 1000, whole_s: Number(said.ready) / 1000, sent_bytes: Number(said.bytes),
  frame_ms_part: Math.round(part), frame_ms_part_and_all_paths: Math.round(all), frame_ms_while_moving: Math.round(moving), heap_mb: Math.round(said.heap / 1e6),
}));
await browser.close();
