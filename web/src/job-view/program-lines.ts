// The lines of the program around the one that runs, if the job delivers its program.
import { ask, type JobFiles } from "../shared/api";
import { el, fill } from "../shared/dom";

const AROUND = [-2, -1, 0, 1, 2];

export class ProgramLines {
  readonly node = el("pre", { class: "program", tabindex: 0, role: "group", "aria-label": "Program lines at this time", hidden: true });
  private loaded: { name: string; lines: string[] } | null = null;
  private wanted: { name: string; line: number } | null = null;

  constructor(private readonly files: JobFiles) {}

  hide(): void {
    this.wanted = null;
    this.node.hidden = true;
  }

  /** Shows the lines around a line of a program; loads the program first. */
  show(name: string, line: number | null): void {
    if (line) void this.load(name, line);
  }

  private async load(name: string, line: number): Promise<void> {
    const file = this.files.items.find((f) => f.name === name);
    if (!file) {
      this.node.hidden = true;
      return;
    }
    this.wanted = { name, line };
    if (this.loaded?.name !== name) {
      const program = (this.loaded = { name, lines: [] as string[] });
      this.node.hidden = true;
      try {
        program.lines = (await (await ask(file.href)).text()).split("\n");
      } catch {
        if (this.loaded === program) this.loaded = null; // the next move of the slider loads again
        return;
      }
      // the slider may have moved meanwhile
      if (this.loaded !== program) return;
    }
    this.draw();
  }

  private draw(): void {
    const lines = this.loaded?.lines ?? [];
    if (!lines.length || !this.wanted) return;
    const now = this.wanted.line;
    const row = (n: number): HTMLElement => el("span", n === now ? { class: "now" } : {}, `${String(n).padStart(6)}  ${lines[n - 1] ?? ""}`);
    this.node.hidden = false;
    fill(this.node, ...AROUND.map((d) => now + d).filter((n) => n >= 1 && n <= lines.length).map(row));
  }
}
