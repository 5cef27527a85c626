// What is said of jobs, findings and what stays.
import { ask, type JobFiles } from "./api";
import { el } from "./dom";
import type { ViewFinding, ViewHead, ViewRest } from "./viewfile";

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

/** What would do for an entry of the remainder, in words. */
export function needs(r: ViewRest): string {
  const w = r.would_need as { kind?: string; diameter_mm?: number; neck_length_mm?: number; stickout_mm?: number; corner_radius_mm?: number };
  if (!w.kind) return [r.tool_at_hand ? `${r.tool_at_hand} would reach it` : "", r.why_left ?? ""].filter(Boolean).join(": ");
  if (w.diameter_mm === undefined) return `needs ${w.kind.replace(/^other /, "another ")}`;
  const neck = w.neck_length_mm !== undefined ? `, neck ${w.neck_length_mm} mm` : "";
  return `needs a ${w.kind} of ${w.diameter_mm} mm${neck}`;
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
