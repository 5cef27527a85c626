// The HTTP interface, with the key of whoever looks at the page. The key is kept for this tab only.
import type { components } from "./wire";

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

export function keep(key: string): void {
  if (key) sessionStorage.setItem(KEY, key);
  else sessionStorage.removeItem(KEY);
}

export function hasKey(): boolean {
  return sessionStorage.getItem(KEY) !== null;
}

export async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  const headers = new Headers(init.headers);
  const key = sessionStorage.getItem(KEY);
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

/** Follows a job until it ends; the answer of a broken stream is to ask again. */
export async function follow(job: Job, onEvent: (event: JobEvent) => void, stop: AbortSignal): Promise<void> {
  let last = "";
  while (!stop.aborted) {
    const answer = await ask(job.links.events, {
      signal: stop,
      headers: last ? { "Last-Event-ID": last } : {},
    });
    if (answer.status === 204 || !answer.body) return;
    let text = "";
    let event = "";
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      text += value;
      let end: number;
      while ((end = text.indexOf("\n")) >= 0) {
        const line = text.slice(0, end).replace(/\r$/, "");
        text = text.slice(end + 1);
        if (line.startsWith("id:")) last = line.slice(3).trim();
        else if (line.startsWith("event:")) event = line.slice(6).trim();
        else if (line.startsWith("data:")) {
          onEvent(JSON.parse(line.slice(5)) as JobEvent);
          if (event === "end") return;
        }
      }
    }
    await new Promise((resume) => setTimeout(resume, 1000));
  }
}
