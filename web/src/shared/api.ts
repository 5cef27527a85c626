// Requests to the HTTP interface, with the key that was entered. The key is stored for this tab only.
import { store, stored } from "./browser-storage";
import type { components } from "../wire";

export type Job = components["schemas"]["Job"];
export type JobPage = components["schemas"]["JobPage"];
export type JobFiles = components["schemas"]["JobFiles"];
export type JobEvent = components["schemas"]["JobEvent"];
export type Problem = components["schemas"]["Problem"];
export type Setup = components["schemas"]["Setup"];
export type LibraryImport = components["schemas"]["LibraryImport"];
export type Tool = components["schemas"]["Tool"];

export const FINAL = new Set(["proved", "clean", "unproved", "done", "failed", "cancelled"]);
const KEY = "zonemill-key";

/** A request that failed, with the problem document of the service. */
export class RequestError extends Error {
  constructor(
    readonly status: number,
    readonly problem: Partial<Problem>,
  ) {
    super(problem.detail ?? `The service answered with status ${status}.`);
  }
}

export function useKey(key: string): void {
  store("sessionStorage", KEY, key || null);
}

export function hasKey(): boolean {
  return stored("sessionStorage", KEY) !== null;
}

export async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  const headers = new Headers(init.headers);
  const key = stored("sessionStorage", KEY);
  if (key) headers.set("Authorization", `Bearer ${key}`);
  let answer: Response;
  try {
    answer = await fetch(path, { ...init, headers });
  } catch {
    throw new RequestError(0, { detail: "The service does not answer.", remedy: "Check that the service runs, then load the page again." });
  }
  if (answer.ok) return answer;
  let problem: Partial<Problem>;
  try {
    problem = (await answer.json()) as Partial<Problem>;
  } catch {
    problem = { detail: `The service answered with status ${answer.status}.` };
  }
  throw new RequestError(answer.status, problem);
}

export async function get<T>(path: string): Promise<T> {
  return (await (await ask(path)).json()) as T;
}
