// The result of a dry check: zones, remainder and tools to add, as tables. A dry check has no 3D view.
import { get, type Job, type JobFiles } from "../shared/api";
import { el, figure } from "../shared/dom";
import { fileList } from "../shared/files";
import type { ViewRest, ViewZone } from "../shared/view-file";
import { counted, cutterWords, needs, slenderness, spaced } from "../shared/wording";

interface OfferedTool {
  kind: string;
  diameter_mm: number;
  corner_radius_mm: number;
  taper_angle_deg?: number;
  neck_length_mm: number;
  area_mm2: number;
}

interface Zones {
  machinable_area_mm2?: number;
  walls: unknown[];
  connections: unknown[];
  zones: ViewZone[];
  remainder: ViewRest[];
  proposal?: { tools: OfferedTool[] };
}

export async function dryCheck(job: Job, files: JobFiles): Promise<HTMLElement> {
  const z = await get<Zones>(job.links.zones!);
  const offers = z.proposal?.tools ?? [];
  return el("div", { class: "dry" },
    el("h2", {}, "Dry check"), el("p", {}, summary(z)),
    offers.length ? section("Tools to add", ["Tool", "Neck length, mm", "Additional area, mm²"], offers.map((t) => [toolName(t), figure(t.neck_length_mm, 1), figure(t.area_mm2, 1)])) : null,
    z.remainder.length ? section("Remainder", ["Reason", "What is needed", "Faces", "mm²"],
      z.remainder.map((r) => [r.reason, [needs(r), slenderness([r])].filter(Boolean).join(", "), r.faces.join(" "), figure(r.area_mm2, 2)])) : null,
    section("Zones", ["Zone", "Tool", "Strategy", "Faces", "mm²"], z.zones.map((x) => [x.id, x.tool, spaced(x.strategy), x.faces.join(" "), figure(x.area_mm2, 1)])),
    el("section", {}, el("h3", {}, "Files"), fileList(files)));
}

function summary(z: Zones): string {
  const rest = z.remainder.reduce((sum, r) => sum + r.area_mm2, 0);
  const all = z.machinable_area_mm2 ?? z.zones.reduce((sum, x) => sum + x.area_mm2, rest);
  return `The part has ${counted(z.walls.length, "wall")} and ${counted(z.connections.length, "connection")}. `
    + `Of its machinable area of ${figure(all, 0, "mm²")} the tools reach ${figure(all - rest, 0, "mm²")} in ${counted(z.zones.length, "zone")}; the remainder is ${figure(rest, 0, "mm²")}. `
    + "Submit the part as a job to see it in 3D.";
}

function toolName(t: OfferedTool): string {
  return `${cutterWords(t, t.taper_angle_deg)}${t.kind.endsWith("bull") ? ` R${t.corner_radius_mm}` : ""}`;
}

function section(title: string, head: string[], rows: string[][]): HTMLElement {
  return el("section", {}, el("h3", {}, title), el("div", { class: "wide", tabindex: 0, role: "group", "aria-label": title }, el("table", { class: "rows2" },
    el("thead", {}, el("tr", {}, ...head.map((h) => el("th", { scope: "col" }, h)))),
    el("tbody", {}, ...rows.map((r) => el("tr", {}, ...r.map((c) => el("td", {}, c))))))));
}
