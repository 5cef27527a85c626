// The HTTP interface, with the key of whoever looks at the page. The key is kept for this tab only.
import { keep, kept } from "./browser-storage";
import type { components } from "../wire";

export type Job = components["schemas"]["Job"];
export type JobPage = components["schemas"]["JobPage"];
export type JobFiles = components["schemas"]["JobFiles"];
export type JobEvent = components["schemas"]["JobEvent"];
export type Problem = components["schemas"]["Problem"];
export type Setup = components["schemas"]["Setup"];
export type Tool = components["schemas"]["Tool"];

export const FINAL = new Set(["proved", "unproved", "done", "failed", "cancelled"]);
const KEY = "zonemill-key";

/** What the service refused, in its own words. */
export class Refusal extends Error {
  constructor(
    readonly status: number,
    readonly problem: Partial<Problem>,
  ) {
    super(problem.detail ?? `the service answered ${status}`);
  }
}

export function useKey(key: string): void {
  keep("sessionStorage", KEY, key || null);
}

export function hasKey(): boolean {
  return kept("sessionStorage", KEY) !== null;
}

export async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  const headers = new Headers(init.headers);
  const key = kept("sessionStorage", KEY);
  if (key) headers.set("Authorization", `Bearer ${key}`);
  let answer: Response;
  try {
    answer = await fetch(path, { ...init, headers });
  } catch {
    throw new Refusal(0, { detail: "The service does not answer.", remedy: "Look whether it runs, and load the page again." });
  }
  if (answer.ok) return answer;
  let problem: Partial<Problem> = {};
  try {
    problem = (await answer.json()) as Partial<Problem>;
  } catch {
    problem = { detail: `The service answered ${answer.status}.` };
  }
  throw new Refusal(answer.status, problem);
}

export async function get<T>(path: string): Promise<T> {
  return (await (await ask(path)).json()) as T;
}

const SILENT_MS = 30_000; // the service says something every ten seconds
const SLOWEST_MS = 15_000;

/**
 * Follows a job until it ends. Where the stream breaks or falls silent, as it does in a phone that was put away, or the
 * service is not there for a while, it asks again; `onLost` is called each time, with the reason.
 */
export async function follow(job: Job, onEvent: (event: JobEvent) => void, onLost: (why: string) => void = () => {}): Promise<void> {
  let last = "";
  let pause = 1000;
  for (;;) {
    try {
      const end = await stream(job, last, (id) => (last = id), (event) => {
        pause = 1000;
        onEvent(event);
      });
      if (end) return;
    } catch (error) {
      // 4xx will be refused again, except for too many streams
      if (error instanceof Refusal && error.status >= 400 && error.status < 500 && error.status !== 429) throw error;
      last = ""; // what stands on the page now is not what the job does
      onLost(error instanceof Refusal ? error.message : "The connection was lost.");
    }
    await new Promise((resume) => setTimeout(resume, pause));
    pause = Math.min(2 * pause, SLOWEST_MS);
  }
}

/** One stream of events; whether the job has ended with it. */
async function stream(job: Job, last: string, onId: (id: string) => void, onEvent: (event: JobEvent) => void): Promise<boolean> {
  const stop = new AbortController();
  let silent = 0;
  const heard = (): void => {
    clearTimeout(silent);
    silent = window.setTimeout(() => stop.abort(), SILENT_MS);
  };
  try {
    heard();
    const answer = await ask(job.links.events, { signal: stop.signal, headers: last ? { "Last-Event-ID": last } : {} });
    if (answer.status === 204 || !answer.body) return true;
    let text = "";
    let event = "";
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return false;
      heard();
      text += value;
      let end: number;
      while ((end = text.indexOf("\n")) >= 0) {
        const line = text.slice(0, end).replace(/\r$/, "");
        text = text.slice(end + 1);
        if (line.startsWith("id:")) onId(line.slice(3).trim());
        else if (line.startsWith("event:")) event = line.slice(6).trim();
        else if (line.startsWith("data:")) {
          onEvent(JSON.parse(line.slice(5)) as JobEvent);
          if (event === "end") return true;
        }
      }
    }
  } finally {
    clearTimeout(silent);
  }
}
