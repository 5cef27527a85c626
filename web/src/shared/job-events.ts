// The stream of events of a running job.
import { RequestError, ask, type Job, type JobEvent } from "./api";

const SILENT_MS = 30_000; // the service sends something every ten seconds
const FIRST_PAUSE_MS = 1000;
const LONGEST_PAUSE_MS = 15_000;
const TOO_MANY_REQUESTS = 429;

/** Whether a request would be refused again. */
export function isFinalRefusal(error: unknown): boolean {
  return error instanceof RequestError && error.status >= 400 && error.status < 500 && error.status !== TOO_MANY_REQUESTS;
}

/**
 * Follows a job until it ends. It connects again where the stream breaks or falls silent, as on a phone in standby, or
 * where the service is away for a while. `onLost` gets the reason each time.
 */
export async function follow(job: Job, onEvent: (event: JobEvent) => void, onLost: (why: string) => void = () => {}): Promise<void> {
  let last = "";
  let pause = FIRST_PAUSE_MS;
  for (;;) {
    try {
      const end = await stream(job, last, (id) => (last = id), (event) => {
        pause = FIRST_PAUSE_MS;
        onEvent(event);
      });
      if (end) return;
    } catch (error) {
      if (isFinalRefusal(error)) throw error;
      last = ""; // the page no longer shows the state of the job
      onLost(error instanceof RequestError ? error.message : "The connection was lost.");
    }
    await new Promise((resume) => setTimeout(resume, pause));
    pause = Math.min(2 * pause, LONGEST_PAUSE_MS);
  }
}

/** Reads one stream of events; returns whether the job has ended. */
async function stream(job: Job, last: string, onId: (id: string) => void, onEvent: (event: JobEvent) => void): Promise<boolean> {
  const stop = new AbortController();
  let silent = 0;
  const restart = (): void => {
    clearTimeout(silent);
    silent = window.setTimeout(() => stop.abort(), SILENT_MS);
  };
  try {
    restart();
    const answer = await ask(job.links.events, { signal: stop.signal, headers: last ? { "Last-Event-ID": last } : {} });
    if (answer.status === 204 || !answer.body) return true;
    let text = "";
    let event = "";
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return false;
      restart();
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
