// What is said of jobs, findings and what stays.
import { ask, type JobFiles } from "./api";
import { el, percent } from "./dom";
import type { ViewFinding, ViewHead, ViewRest } from "./view-file";

export const STATE_WORDS: Record<string, string> = {
  queued: "waiting", running: "running", proved: "proved", unproved: "not proved", done: "done", failed: "failed",
  cancelled: "cancelled",
};

export function stateBadge(state: string): HTMLElement {
  return el("span", { class: `badge ${state}` }, STATE_WORDS[state] ?? state);
}

export function fileList(files: JobFiles): HTMLElement {
  return el("ul", { class: "files" }, ...files.items.filter((f) => f.name !== "view.bin").map((f) =>
    el("li", {}, el("button", { type: "button", class: "link", onclick: (e: Event) => void download(f.href, f.name).catch((error: unknown) =>
      (e.target as Element).parentElement!.append(el("p", { role: "alert", class: "bad" }, error instanceof Error ? error.message : String(error)))) }, f.name),
      ` ${f.size_bytes > 1e6 ? `${(f.size_bytes / 1e6).toFixed(1)} MB` : `${Math.ceil(f.size_bytes / 1e3)} kB`}`)));
}

/** A file through the interface, so that the key goes with it. */
async function download(href: string, file: string): Promise<void> {
  const blob = await (await ask(href)).blob();
  const url = URL.createObjectURL(blob);
  el("a", { href: url, download: file }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

export function whereOf(f: ViewFinding): string {
  const at = f.point ? ` at X ${f.point[0].toFixed(2)} Y ${f.point[1].toFixed(2)} Z ${f.point[2].toFixed(2)}` : "";
  return `${f.kind}: ${f.message}${f.line ? `; ${f.program} line ${f.line}` : ""}${at}`;
}

const OTHERS: Record<string, string> = { "other access": "another tool axis", "other process": "another process" };

interface Need {
  kind?: string;
  diameter_mm?: number;
  corner_radius_mm?: number;
  neck_length_mm?: number;
  shank_diameter_mm?: number;
  stickout_mm?: number;
  share?: number;
  slenderness?: number;
  access?: string;
}

/** How slender a tool would be, in words, from the least to the most of some entries; nothing where none says it. */
export function slender(all: ViewRest[]): string {
  const times = all.map((r) => (r.would_need as Need).slenderness).filter((v) => v !== undefined).sort((a, b) => a - b);
  const [least, most] = [times[0]?.toFixed(1), times[times.length - 1]?.toFixed(1)];
  return times.length ? `as a tool would be ${least === most ? least : `${least} to ${most}`} times as long as thick` : "";
}

/** What would do for an entry of the remainder, in words; with `slender` as much as the sheet says (service/setup_sheet/tables.py). */
export function needs(r: ViewRest): string {
  const w = r.would_need as Need;
  const round = w.kind === "bull" ? ` with a corner of ${w.corner_radius_mm} mm` : "";
  return [
    r.why_left,
    r.tool_at_hand && `${r.tool_at_hand} would reach it`,
    w.diameter_mm !== undefined && `needs a ${w.kind} of ${w.diameter_mm} mm${round}, neck ${w.neck_length_mm} mm, shank ${w.shank_diameter_mm} mm, stickout ${w.stickout_mm} mm`,
    w.diameter_mm !== undefined && (w.share ?? 1) < 1 && `for ${percent(w.share)} of it`,
    w.diameter_mm === undefined && w.kind && `needs ${OTHERS[w.kind] ?? w.kind}`,
    w.access && `along ${w.access}`,
  ].filter(Boolean).join(", ") || "no tool would reach it";
}

export function keyTable(): HTMLElement {
  const rows: [string, string][] = [["arrows", "turn"], ["shift + arrows", "move"], ["+ −", "nearer, farther"], ["F 7 1 3", "all, top, front, side"],
    ["Z W D", "zones, walls, deviation"], ["N P", "next finding, the one before"], ["space", "play, pause"], [", .", "one second back, on"], ["Enter", "what is under the cross"], ["M", "measure"], ["Esc", "put tool and ruler away"]];
  return el("table", { class: "keys" }, el("caption", {}, "Keys, while the picture has the focus"), el("tbody", {}, ...rows.map(([k, w]) => el("tr", {}, el("th", { scope: "row" }, el("kbd", {}, k)), el("td", {}, w)))));
}

/** "ball D3" of a T number; nothing where the setup has no such tool. */
export function toolWords(h: ViewHead, number: number): string {
  const t = h.tools.find((x) => x.number === number);
  return t ? `${t.kind} D${t.diameter_mm}` : "";
}
