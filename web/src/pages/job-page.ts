// The page of one job: its progress while it runs, then its view.
import { FINAL, RequestError, ask, get, type Job, type JobFiles } from "../shared/api";
import { el, fill } from "../shared/dom";
import { fileList } from "../shared/files";
import { follow } from "../shared/job-events";
import { dryCheck } from "./dry-check";
import { pageHeader, showError } from "../shared/page-frame";
import { JobView } from "../job-view/job-view";
import { BrokenView, readView } from "../shared/view-file";
import { stateBadge } from "../shared/wording";

const PICTURES = [["preview.png", "The part with its zones, and the tool paths"], ["deviation.png", "The deviation that the proof measured on the part"]] as const;

export async function jobPage(app: HTMLElement, id: string): Promise<void> {
  const title = el("h1", { class: "title" }, "Job");
  const main = el("main", { id: "main", class: "job" });
  fill(app, pageHeader(title), main);
  const again = (): void => void jobPage(app, id);
  try {
    const job = await get<Job>(`/v1/jobs/${encodeURIComponent(id)}`);
    name(title, job);
    if (!FINAL.has(job.state)) {
      await wait(main, job);
      again();
      return;
    }
    if (job.state === "failed" || job.state === "cancelled") {
      fill(main, el("div", { class: "refusal", role: "alert" },
        el("h2", {}, job.error?.title ?? `The job was ${job.state}`),
        job.error ? el("p", {}, job.error.detail) : null,
        job.error?.remedy ? el("p", {}, el("strong", {}, "Remedy: "), job.error.remedy) : null,
        el("p", {}, el("a", { href: "/" }, "All jobs"))));
      return;
    }
    await show(main, job, again);
  } catch (error) {
    showError(main, error, again);
  }
}

function name(title: HTMLElement, job: Job): void {
  const order = job.labels?.order ?? job.labels?.part ?? `Job ${job.id.slice(0, 9)}…`;
  document.title = `${order}: ${job.state} · zonemill`;
  fill(title, order, " ", stateBadge(job.state));
}

async function wait(main: HTMLElement, job: Job): Promise<void> {
  const bar = el("progress", { max: 1, value: job.progress, "aria-label": "Progress of the job" });
  const words = el("p", { role: "status" });
  fill(main, el("section", { class: "waiting" }, el("h2", {}, "The job is running"), bar, words,
    el("p", { class: "hint" }, "This page shows the result when the job ends. You may close the page; the job continues.")));
  const say = (stage: string, progress: number): void => {
    bar.value = progress;
    words.textContent = `${Math.round(100 * progress)} %, ${stage || "queued"}`;
  };
  say(job.stage, job.progress);
  await follow(job, (event) => say(event.stage, event.progress), (why) => (words.textContent = `${why} The page reconnects by itself.`));
}

async function show(main: HTMLElement, job: Job, again: () => void): Promise<void> {
  const opened = performance.now();
  const files = await get<JobFiles>(`/v1/jobs/${job.id}/files`);
  const view = files.items.find((f) => f.name === "view.bin");
  if (!view) {
    if (job.kind === "zones") fill(main, await dryCheck(job, files));
    else fill(main, el("div", { class: "refusal" }, el("h2", {}, "This job has no 3D view"),
      el("p", {}, "An earlier version of zonemill made this job. Submit the same part and setup again."),
      fileList(files), el("p", {}, el("a", { href: "/" }, "All jobs"))));
    return;
  }
  let page: JobView;
  try {
    page = new JobView(job, files);
  } catch {
    fill(main, await flat(files, "This browser has no WebGL 2, or WebGL 2 is switched off.", again));
    return;
  }
  fill(main, ...page.nodes);
  document.body.classList.add("viewing");
  page.start();
  try {
    const answer = await ask(view.href);
    if (!answer.body) throw new Error("the answer has no data");
    let first = true;
    const bytes = await readView(answer.body, (h) => page.begin(h), (entry, table) => {
      if (first && entry.lod > 0) {
        first = false;
        page.roughDone(performance.now() - opened);
      }
      page.scene.chunk(entry, table);
    });
    page.finish(bytes, performance.now() - opened);
  } catch (error) {
    document.body.classList.remove("viewing");
    if (error instanceof RequestError) showError(main, error, again);
    else fill(main, await flat(files, error instanceof BrokenView ? error.message : "The view file is damaged.", again));
  }
}

/** A job without its 3D view: the reason, the pictures, and the files. */
async function flat(files: JobFiles, why: string, again: () => void): Promise<HTMLElement> {
  const drawn = await Promise.all(PICTURES.map(async ([name, words]) => {
    const file = files.items.find((f) => f.name === name);
    if (!file) return null;
    try {
      return el("img", { src: URL.createObjectURL(await (await ask(file.href)).blob()), alt: words });
    } catch {
      return null; // the list of files has it
    }
  }));
  return el("div", { class: "flat" },
    el("div", { class: "refusal", role: "alert" }, el("h2", {}, "The 3D view cannot be shown"), el("p", {}, why),
      el("button", { type: "button", onclick: again }, "Try again")),
    ...drawn, el("section", {}, el("h2", {}, "Files"), fileList(files)));
}
