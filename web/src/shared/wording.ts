// Words for states, findings, tools and the remainder.
import { el, percent } from "./dom";
import type { ViewFinding, ViewHead, ViewRest } from "./view-file";

export function stateBadge(state: string): HTMLElement {
  return el("span", { class: `badge ${state}` }, state);
}

/** A word of the report for people: "planar_floor" reads "planar floor". */
export function spaced(word: string): string {
  return word.replace(/_/g, " ");
}

/** "1 wall", "2 walls". */
export function counted(n: number, noun: string): string {
  return `${n} ${noun}${n === 1 ? "" : "s"}`;
}

/** Kind, message, line and place of a finding. */
export function findingPlace(f: ViewFinding): string {
  const at = f.point ? ` at X ${f.point[0].toFixed(2)} Y ${f.point[1].toFixed(2)} Z ${f.point[2].toFixed(2)}` : "";
  return `${f.kind}: ${f.message}${f.line ? `; ${f.program} line ${f.line}` : ""}${at}`;
}

/** "ball D3", "tapered ball D1 3°", "lens D6 R20". */
export function cutterWords(t: { kind: string; diameter_mm: number; profile_radius_mm?: number }, taper?: number): string {
  const profile = t.profile_radius_mm ? ` R${t.profile_radius_mm}` : "";
  return `${spaced(t.kind)} D${t.diameter_mm}${profile}${taper ? ` ${taper}°` : ""}`;
}

/** The same for a T number; empty if the setup has no such tool. */
export function toolWords(h: ViewHead, number: number): string {
  const t = h.tools.find((x) => x.number === number);
  return t ? cutterWords(t, t.taper_deg) : "";
}

const OTHER_NEEDS: Record<string, string> = { "other access": "another tool axis", "other process": "another process" };

interface Need {
  kind?: string;
  diameter_mm?: number;
  corner_radius_mm?: number;
  taper_angle_deg?: number;
  neck_length_mm?: number;
  shank_diameter_mm?: number;
  stickout_mm?: number;
  share?: number;
  slenderness?: number;
  access?: string;
}

/** How slender a tool would have to be, over some entries of the remainder; empty where none says it. */
export function slenderness(all: ViewRest[]): string {
  const ratios = all.map((r) => (r.would_need as Need).slenderness).filter((v) => v !== undefined).sort((a, b) => a - b);
  const [least, most] = [ratios[0]?.toFixed(1), ratios[ratios.length - 1]?.toFixed(1)];
  return ratios.length ? `because a tool would be ${least === most ? least : `${least} to ${most}`} times as long as its diameter` : "";
}

/** What would cut an entry of the remainder. With `slenderness` it says as much as the setup sheet (service/setup_sheet/tables.py). */
export function needs(r: ViewRest): string {
  const w = r.would_need as Need;
  const corner = w.kind?.endsWith("bull") ? ` with corner radius ${w.corner_radius_mm} mm` : "";
  const cone = w.taper_angle_deg ? ` and ${w.taper_angle_deg}°` : "";
  return [
    r.why_left,
    r.tool_at_hand && `${r.tool_at_hand} would reach it`,
    w.diameter_mm !== undefined && `needs a ${spaced(w.kind!)} of ${w.diameter_mm} mm${cone}${corner}, neck ${w.neck_length_mm} mm, shank ${w.shank_diameter_mm} mm, stickout ${w.stickout_mm} mm`,
    w.diameter_mm !== undefined && (w.share ?? 1) < 1 && `for ${percent(w.share)} of the area`,
    w.diameter_mm === undefined && w.kind && `needs ${OTHER_NEEDS[w.kind] ?? w.kind}`,
    w.access && `along ${w.access}`,
  ].filter(Boolean).join(", ") || "no tool would reach it";
}
