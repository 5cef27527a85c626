// The start page: the form of a new job, and all jobs with their progress.
import { FINAL, RequestError, ask, get, type Job, type JobPage } from "../shared/api";
import { el, fill } from "../shared/dom";
import { follow, isFinalRefusal } from "../shared/job-events";
import { pageHeader, showError } from "../shared/page-frame";
import { stateBadge } from "../shared/wording";
import { JobForm } from "./job-form";

const PAGE_LENGTH = 30;
const MAX_STREAMS = 3; // a browser keeps six connections to a host, and the page needs some itself
const POLL_MS = 4000;
const KINDS: Record<string, string> = { plan: "job", zones: "dry check", verify: "verification" };

type OnProgress = (now: { progress: number; stage: string }) => void;

export async function listPage(app: HTMLElement): Promise<void> {
  document.title = "Jobs · zonemill";
  const list = el("div", { class: "jobs" });
  const again = (): void => {
    fill(list);
    void load(list, again);
    form.load(); // what was entered stays
  };
  const form = new JobForm(again);
  const main = el("main", { id: "main", class: "list" }, form.node, el("section", { "aria-labelledby": "jobs" }, el("h2", { id: "jobs" }, "Jobs"), list));
  fill(app, pageHeader(el("h1", { class: "title" }, "Jobs")), main);
  await load(list, again);
}

async function load(list: HTMLElement, again: () => void, cursor = ""): Promise<void> {
  let page: JobPage;
  try {
    page = await get<JobPage>(`/v1/jobs?limit=${PAGE_LENGTH}${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`);
  } catch (error) {
    showError(list, error, again);
    return;
  }
  if (!cursor && !page.items.length) fill(list, el("p", { class: "hint" }, "There are no jobs yet. Fill in the form on this page, or run make demo."));
  for (const job of page.items) list.appendChild(row(job));
  if (page.next_cursor) {
    const next = page.next_cursor;
    const more = el("button", { type: "button", onclick: () => {
      more.remove();
      void load(list, again, next);
    } }, "Older jobs");
    list.appendChild(more);
  }
}

let streams = 0;

/** Follows a job by its events, or by polling while many jobs run; returns the job as it ended. */
async function watch(job: Job, onProgress: OnProgress, onLost: (why: string) => void): Promise<Job> {
  if (streams < MAX_STREAMS) {
    streams++;
    try {
      await follow(job, onProgress, onLost);
    } finally {
      streams--;
    }
    return get<Job>(job.links.self);
  }
  for (;;) {
    await new Promise((resume) => setTimeout(resume, POLL_MS));
    let now: Job;
    try {
      now = await get<Job>(job.links.self);
    } catch (error) {
      if (isFinalRefusal(error)) throw error;
      onLost(error instanceof RequestError ? error.message : "The connection was lost.");
      continue;
    }
    if (FINAL.has(now.state)) return now;
    onProgress(now);
    if (streams < MAX_STREAMS) return watch(now, onProgress, onLost);
  }
}

function errorWords(error: unknown): string {
  return error instanceof RequestError ? error.message : "The connection was lost. Load the page again.";
}

function row(job: Job): HTMLElement {
  const node = el("article", { class: "jobrow" });
  draw(node, job);
  return node;
}

function draw(node: HTMLElement, job: Job): void {
  const running = !FINAL.has(job.state);
  const bar = el("progress", { max: 1, value: job.progress, "aria-label": "Progress" });
  const words = el("span", { class: "where" }, running ? `${Math.round(100 * job.progress)} % ${job.stage}` : "");
  const showFailure = (error: unknown): void => void (words.textContent = errorWords(error));
  const order = job.labels?.order ?? job.labels?.part ?? `${job.id.slice(0, 13)}…`;
  fill(node, el("h3", {}, el("a", { href: `/v1/jobs/${job.id}/view` }, order)), stateBadge(job.state),
    el("span", { class: "where" }, `${KINDS[job.kind] ?? job.kind}, ${new Date(job.created_at).toLocaleString()}`),
    running ? bar : null, running ? words : null,
    running ? el("button", { type: "button", onclick: () => void ask(job.links.self, { method: "DELETE" }).catch(showFailure) }, "Cancel") : null,
    job.error ? el("p", { class: "where" }, job.error.detail) : null);
  if (!running) return;
  const onProgress: OnProgress = ({ progress, stage }) => {
    bar.value = progress;
    words.textContent = `${Math.round(100 * progress)} % ${stage}`;
  };
  watch(job, onProgress, (why) => (words.textContent = why)).then((ended) => draw(node, ended), showFailure);
}
