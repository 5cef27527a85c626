// How one looks at a job, as it stands in the address.
import type { Mode } from "../scene/scene";

export interface Look {
  c?: number[];
  m?: Mode;
  t?: number;
  s?: [number, number, number];
  p?: string;
}

/** The look in the address: `#c=...&m=deviation&t=12.5&s=0,0.5,0`. */
export function lookOf(hash: string): Look {
  const q = new URLSearchParams(hash.replace(/^#/, ""));
  const numbers = (key: string, n: number): number[] | undefined => {
    const v = (q.get(key) ?? "none").split(",").map(Number);
    return v.length === n && v.every(Number.isFinite) ? v : undefined;
  };
  const out: Look = {};
  const c = numbers("c", 6);
  if (c) out.c = c;
  const m = q.get("m");
  if (m === "zones" || m === "walls" || m === "deviation") out.m = m;
  const t = numbers("t", 1);
  if (t) out.t = t[0]!;
  const s = numbers("s", 3);
  if (s) out.s = s as [number, number, number];
  const p = q.get("p");
  if (p) out.p = p;
  return out;
}
