// The list of a job's files.
import { ask, type JobFiles } from "./api";
import { el } from "./dom";

const KEPT_MS = 10_000; // a browser needs the data until the download has begun

export function fileList(files: JobFiles): HTMLElement {
  return el("ul", { class: "files" }, ...files.items.filter((f) => f.name !== "view.bin").map((f) =>
    el("li", {}, el("button", { type: "button", class: "link", onclick: (e: Event) => void download(f.href, f.name).catch((error: unknown) =>
      (e.target as Element).parentElement!.append(el("p", { role: "alert", class: "bad" }, error instanceof Error ? error.message : String(error)))) }, f.name),
      ` ${sizeWords(f.size_bytes)}`)));
}

function sizeWords(bytes: number): string {
  return bytes > 1e6 ? `${(bytes / 1e6).toFixed(1)} MB` : `${Math.ceil(bytes / 1e3)} kB`;
}

/** Downloads a file with the key of the tab. */
async function download(href: string, file: string): Promise<void> {
  const blob = await (await ask(href)).blob();
  const url = URL.createObjectURL(blob);
  el("a", { href: url, download: file }).click();
  setTimeout(() => URL.revokeObjectURL(url), KEPT_MS);
}
