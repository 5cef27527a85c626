// A dry check has no picture: what the tools reach, what stays and why, and the tools to add, as tables.
import { get, type Job, type JobFiles } from "../shared/api";
import { el, figure } from "../shared/dom";
import type { ViewRest, ViewZone } from "../shared/view-file";
import { fileList, needs, slender } from "../shared/wording";

interface Zones {
  machinable_area_mm2?: number;
  walls: unknown[];
  connections: unknown[];
  zones: ViewZone[];
  remainder: ViewRest[];
  proposal?: { tools: { kind: string; diameter_mm: number; corner_radius_mm: number; neck_length_mm: number; area_mm2: number }[] };
}

export async function dryCheck(job: Job, files: JobFiles): Promise<HTMLElement> {
  const z = await get<Zones>(job.links.zones!);
  const stays = z.remainder.reduce((sum, r) => sum + r.area_mm2, 0);
  const all = z.machinable_area_mm2 ?? z.zones.reduce((sum, x) => sum + x.area_mm2, stays);
  const offers = z.proposal?.tools ?? [];
  return el("div", { class: "dry" },
    el("h2", {}, "Dry check"),
    el("p", {}, `${z.walls.length} walls, ${z.connections.length} connections. Of ${figure(all, 0, "mm²")} to be machined ${figure(all - stays, 0, "mm²")} are in reach, in ${z.zones.length} zones; ${figure(stays, 0, "mm²")} are not. Post the part as a job to see it.`),
    offers.length ? el("section", {}, el("h3", {}, "Tools that would help"), table(["Tool", "Neck, mm", "Reaches more, mm²"],
      offers.map((t) => [`${t.kind} D${t.diameter_mm}${t.kind === "bull" ? ` R${t.corner_radius_mm}` : ""}`, figure(t.neck_length_mm, 1), figure(t.area_mm2, 1)]))) : null,
    z.remainder.length ? el("section", {}, el("h3", {}, "What stays"), table(["Reason", "What would do", "Faces", "mm²"],
      z.remainder.map((r) => [r.reason, [needs(r), slender([r])].filter(Boolean).join(", "), r.faces.join(" "), figure(r.area_mm2, 2)]))) : null,
    el("section", {}, el("h3", {}, "Zones"), table(["Zone", "Tool", "Strategy", "Faces", "mm²"], z.zones.map((x) => [x.id, x.tool, x.strategy, x.faces.join(" "), figure(x.area_mm2, 1)]))),
    fileList(files));
}

function table(head: string[], rows: string[][]): HTMLElement {
  return el("div", { class: "wide", tabindex: 0, role: "group", "aria-label": head[0] ?? "" }, el("table", { class: "rows2" },
    el("thead", {}, el("tr", {}, ...head.map((h) => el("th", { scope: "col" }, h)))),
    el("tbody", {}, ...rows.map((r) => el("tr", {}, ...r.map((c) => el("td", {}, c)))))));
}
