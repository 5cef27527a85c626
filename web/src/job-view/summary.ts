// Counts of findings, cautions and notes, and the sentence that sums a job up.
import type { ViewHead } from "../shared/view-file";
import { counted } from "../shared/wording";

/** Findings of the report, including those that the list leaves out. */
export function findingCount(h: ViewHead): number {
  return Math.max(h.findings.length, Object.values(h.found ?? {}).reduce((sum, n) => sum + n, 0));
}

export function cautionCount(h: ViewHead): number {
  return (h.cautions?.length ?? 0) + (h.notes?.length ?? 0);
}

export function summaryOf(h: ViewHead): string {
  const undone = h.state === "clean" ? "The program does no harm, but work is left undone: " : "";
  if (h.findings.length) return `${undone}${counted(findingCount(h), "finding")}. ${h.withheld ? "The program is withheld. " : ""}Choose a finding in the list to see its place.`;
  const n = cautionCount(h);
  const granted = h.assumed?.length ? ` ${counted(h.assumed.length, "fact")} taken for granted.` : "";
  const cautions = granted + (n ? ` See the ${n === 1 ? "caution or note" : `${n} cautions and notes`}.` : "");
  if (h.kind === "verify") return `Proved. The map shows what the program leaves on the part.${cautions}`;
  if (!h.remainder.length) return `Proved and complete.${cautions}`;
  return `Proved. ${h.remainder.some((r) => r.tool_at_hand) ? "The area hatched red remains" : "No tool of the setup reaches the area hatched red"}; see Remainder.${cautions}`;
}
