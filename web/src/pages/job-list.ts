// All jobs with their progress as it goes, and the form for a new one.
import { FINAL, Refusal, ask, follow, get, type Job, type JobPage } from "../shared/api";
import { el, fill } from "../shared/dom";
import { head, showRefusal } from "../shared/page-frame";
import { jobForm } from "./job-form";
import { stateBadge } from "../shared/wording";

export async function listPage(app: HTMLElement): Promise<void> {
  document.title = "Jobs · zonemill";
  const list = el("div", { class: "jobs" });
  const again = (): void => {
    fill(list);
    void load(list, again);
    form.again(); // what was written into it stays
  };
  const form = jobForm(again);
  const main = el("main", { id: "main", class: "list" }, form.node, el("section", { "aria-labelledby": "jobs" }, el("h2", { id: "jobs" }, "Jobs"), list));
  fill(app, head(el("h1", { class: "title" }, "Jobs")), main);
  await load(list, again);
}

async function load(list: HTMLElement, again: () => void, cursor = ""): Promise<void> {
  let page: JobPage;
  try {
    page = await get<JobPage>(`/v1/jobs?limit=30${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`);
  } catch (error) {
    showRefusal(list, error, again);
    return;
  }
  if (!cursor && !page.items.length) fill(list, el("p", { class: "hint" }, "There are none yet. Post a part above, or run make demo."));
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

const STREAMS = 3; // at a time: a browser keeps six connections to a host, and the page needs some itself
let streams = 0;

/** Follows a job by its events, or where many run by asking now and then; returns it as it ended. */
async function watch(job: Job, say: (now: { progress: number; stage: string }) => void, lost: (why: string) => void): Promise<Job> {
  if (streams < STREAMS) {
    streams++;
    try {
      await follow(job, say, lost);
    } finally {
      streams--;
    }
    return get<Job>(job.links.self);
  }
  for (;;) {
    await new Promise((resume) => setTimeout(resume, 4000));
    let now: Job;
    try {
      now = await get<Job>(job.links.self);
    } catch (error) {
      if (error instanceof Refusal && error.status >= 400 && error.status < 500 && error.status !== 429) throw error;
      lost(error instanceof Refusal ? error.message : "The connection was lost.");
      continue;
    }
    if (FINAL.has(now.state)) return now;
    say(now);
    if (streams < STREAMS) return watch(now, say, lost);
  }
}

function told(error: unknown): string {
  return error instanceof Refusal ? error.message : "The connection was lost; load the page again.";
}

const KINDS: Record<string, string> = { plan: "job", zones: "dry check", verify: "verification" };

function row(job: Job): HTMLElement {
  const node = el("article", { class: "jobrow" });
  const draw = (j: Job): void => {
    const running = !FINAL.has(j.state);
    const bar = el("progress", { max: 1, value: j.progress, "aria-label": "Progress" });
    const words = el("span", { class: "where" }, running ? `${Math.round(100 * j.progress)} % ${j.stage}` : "");
    const order = j.labels?.order ?? j.labels?.part ?? `${j.id.slice(0, 13)}…`;
    fill(node, el("h3", {}, el("a", { href: `/v1/jobs/${j.id}/view` }, order)), stateBadge(j.state),
      el("span", { class: "where" }, `${KINDS[j.kind] ?? j.kind}, ${new Date(j.created_at).toLocaleString()}`),
      running ? bar : null, running ? words : null,
      running ? el("button", { type: "button", onclick: () => void ask(j.links.self, { method: "DELETE" }).catch((error: unknown) => (words.textContent = told(error))) }, "Cancel") : null,
      j.error ? el("p", { class: "where" }, j.error.detail) : null);
    if (running)
      void watch(j, (now) => {
        bar.value = now.progress;
        words.textContent = `${Math.round(100 * now.progress)} % ${now.stage}`;
      }, (why) => (words.textContent = why)).then(draw, (error: unknown) => (words.textContent = told(error)));
  };
  draw(job);
  return node;
}
