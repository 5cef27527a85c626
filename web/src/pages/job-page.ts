// One job: progress while it runs, then the picture with all that belongs to it.
import { FINAL, Refusal, ask, follow, get, type Job, type JobFiles } from "../shared/api";
import { el, fill } from "../shared/dom";
import { dryCheck } from "./dry-check";
import { head, showRefusal } from "../shared/page-frame";
import { JobView } from "../job-view/job-view";
import { BrokenView, readView } from "../shared/view-file";
import { STATE_WORDS, fileList, stateBadge } from "../shared/wording";

const PICTURES = [["preview.png", "The part with its zones, and the tool paths"], ["deviation.png", "What the proof measured on the part"]] as const;

export async function jobPage(app: HTMLElement, id: string): Promise<void> {
  const title = el("h1", { class: "title" }, "Job");
  const main = el("main", { id: "main", class: "job" });
  fill(app, head(title), main);
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
        job.error?.remedy ? el("p", {}, el("strong", {}, "What to do: "), job.error.remedy) : null,
        el("p", {}, el("a", { href: "/" }, "All jobs"))));
      return;
    }
    await show(main, job, again);
  } catch (error) {
    showRefusal(main, error, again);
  }
}

function name(title: HTMLElement, job: Job): void {
  const order = job.labels?.order ?? job.labels?.part ?? `Job ${job.id.slice(0, 9)}…`;
  document.title = `${order}: ${STATE_WORDS[job.state] ?? job.state} · zonemill`;
  fill(title, order, " ", stateBadge(job.state));
}

async function wait(main: HTMLElement, job: Job): Promise<void> {
  const bar = el("progress", { max: 1, value: job.progress, "aria-label": "Progress of the job" });
  const words = el("p", { role: "status" });
  fill(main, el("section", { class: "waiting" }, el("h2", {}, "The job is being worked on"), bar, words,
    el("p", { class: "hint" }, "This page goes on by itself when it ends; it may be closed meanwhile.")));
  const say = (stage: string, progress: number): void => {
    bar.value = progress;
    words.textContent = `${Math.round(100 * progress)} %, ${stage || "waiting for its turn"}`;
  };
  say(job.stage, job.progress);
  await follow(job, (event) => say(event.stage, event.progress), (why) => (words.textContent = `${why} This page asks again by itself.`));
}

async function show(main: HTMLElement, job: Job, again: () => void): Promise<void> {
  const opened = performance.now();
  const files = await get<JobFiles>(`/v1/jobs/${job.id}/files`);
  const view = files.items.find((f) => f.name === "view.bin");
  if (!view) {
    if (job.kind === "zones") fill(main, await dryCheck(job, files));
    else fill(main, el("div", { class: "refusal" }, el("h2", {}, "This job has no picture"),
      el("p", {}, "It was made by an earlier version. Post the same part and setup again."),
      fileList(files), el("p", {}, el("a", { href: "/" }, "All jobs"))));
    return;
  }
  let page: JobView;
  try {
    page = new JobView(job, files);
  } catch {
    fill(main, await flat(files, "This browser draws nothing in three dimensions: it has no WebGL 2, or has it switched off.", again));
    return;
  }
  fill(main, ...page.nodes);
  document.body.classList.add("viewing");
  page.start();
  try {
    const answer = await ask(view.href);
    if (!answer.body) throw new Error("the browser gave no data");
    let first = true;
    const bytes = await readView(answer.body as ReadableStream<Uint8Array<ArrayBuffer>>, (h) => page.begin(h), (entry, table) => {
      if (first && entry.lod > 0) {
        first = false;
        page.roughDone(performance.now() - opened);
      }
      page.picture.chunk(entry, table);
    });
    page.finish(bytes, performance.now() - opened);
  } catch (error) {
    document.body.classList.remove("viewing");
    if (error instanceof Refusal) showRefusal(main, error, again);
    else fill(main, await flat(files, error instanceof BrokenView ? error.message : "The file with the picture is damaged.", again));
  }
}

/** What a job has to show without the picture: why there is none, the drawn pictures, and the files. */
async function flat(files: JobFiles, why: string, again: () => void): Promise<HTMLElement> {
  const drawn = await Promise.all(PICTURES.map(async ([name, words]) => {
    const file = files.items.find((f) => f.name === name);
    if (!file) return null;
    try {
      return el("img", { src: URL.createObjectURL(await (await ask(file.href)).blob()), alt: words });
    } catch {
      return null; // it stands in the list of files
    }
  }));
  return el("div", { class: "flat" },
    el("div", { class: "refusal", role: "alert" }, el("h2", {}, "The picture cannot be shown"), el("p", {}, why),
      el("button", { type: "button", onclick: again }, "Try again")),
    ...drawn, el("section", {}, el("h2", {}, "Files"), fileList(files)));
}
