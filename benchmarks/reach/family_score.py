"""How often the decomposition is right on random parts of the public family.

    python -m benchmarks.reach.family_score --seeds 0:40 [--recipe mixed] [--jobs 2] [--limit 300] [--out
    out/family_score]

Every part is made, read and decomposed in a child process with a time limit; what a child answers is kept in a cache
folder under the name of recipe, seed and a digest of the sources it depends on, so a broken run goes on where it
stopped and a changed program is asked again. Compared with the truth: number of walls, which wall is which, walls of
every connection, least gap of primary channels (2 %), profile type of every wall side. Each part that is not all right
gets a picture and a line of cause data. Seeds below 31000 are for work on the program, 31000 to 31299 for the score.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

CHORD = 0.004
GAP_TOLERANCE = 0.02
NARROW = 12.0
"""mm; up to this the least gaps of neighbouring walls are drawn, wider ones come about past the ends of others."""
NEAR = 0.1
"""mm; a truth side point belongs to the found wall whose side faces come this near."""
SOURCES = {"make": ["examples"], "judge": ["examples", "geometry", "zones"]}
ROOT = Path(__file__).resolve().parents[2]


def digest_of(folders: list[str]) -> str:
    """Twelve hex digits of all sources in some top-level folders."""
    h = hashlib.sha256(Path(__file__).read_bytes())
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            h.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return h.hexdigest()[:12]


def made_part(recipe: str, seed: int, cache: Path) -> tuple[Path, dict[str, Any], float]:
    """STEP path, truth and seconds of a part, made once."""
    from examples.family.recipes import make_part

    folder = cache / f"parts-{digest_of(SOURCES['make'])}"
    name = f"{recipe}-{seed}"
    step, truth = folder / f"{name}.step", folder / f"{name}.truth.json"
    begin = time.perf_counter()
    if not (folder / f"{name}.setup.json").exists():
        make_part(seed, recipe).write(folder)
    return step, json.loads(truth.read_text()), time.perf_counter() - begin


def judge(recipe: str, seed: int, cache: Path, pictures: Path, limit: float) -> dict[str, Any]:
    """Decompose one part and hold it against its truth; plain data, see ``compare``."""
    from geometry.step_import.reader import read_part
    from zones.features.decomposition import decompose

    step, truth, made = made_part(recipe, seed, cache)
    begin = time.perf_counter()
    part = read_part(step, chord=CHORD, time_limit=limit)
    read = time.perf_counter() - begin
    begin = time.perf_counter()
    found = decompose(part)
    seconds = {"make": made, "read": read, "decompose": time.perf_counter() - begin}
    out = compare(part, found, truth)
    out |= {"seed": seed, "recipe": recipe, "features": truth["features"], "facets": len(part.mesh.faces),
            "seconds": {k: round(v, 2) for k, v in seconds.items()}}
    if not out["right"]:
        pictures.mkdir(parents=True, exist_ok=True)
        title = f"{recipe} {seed}: " + "; ".join(out["causes"])[:110]
        draw(part, found, pictures / f"{recipe}-{seed}.png", title)
    return out


def draw(part: Any, found: Any, out: Path, title: str) -> None:
    """The part with a colour for every wall, and orange for what was taken for a connection."""
    import numpy as np
    from PIL import Image, ImageDraw

    from service.pictures.annotation import font
    from service.pictures.camera import Camera
    from service.pictures.scene import shaded
    from service.viewer.preview_picture import CONNECTION, OTHER, zone_colour

    colours = np.full((len(part.faces) + 1, 3), OTHER, np.float32)
    for index, wall in enumerate(found.walls):
        colours[list(wall.faces)] = zone_colour(index)
    for connection in found.connections:
        colours[list(connection.faces)] = CONNECTION
    camera = Camera.fit(part.mesh.vertices, (2400, 1600), azimuth=np.radians(-58.0), elevation=np.radians(38.0))
    picture = Image.fromarray(shaded(part, colours, camera).halved())
    ImageDraw.Draw(picture).text((20, 14), title, font=font(22), fill=(25, 30, 38))
    picture.save(out)


def compare(part: Any, found: Any, truth: dict[str, Any]) -> dict[str, Any]:
    """Hold a decomposition against the truth of a part.

    part, found : Part and Decomposition
    truth       : of the family
    Returns per question right and total, and one line for each thing that is wrong.
    """
    causes: list[str] = []
    place = match_walls(part, found, truth["walls"], causes)
    walls = len(found.walls) == len(truth["walls"]) and sorted(place.values()) == list(range(len(truth["walls"])))
    if not walls:
        causes.append(f"walls {len(found.walls)} of {len(truth['walls'])}")
    wanted = Counter(tuple(sorted(c["walls"])) for c in truth["connections"])
    got = Counter(tuple(sorted(place.get(w, -1) for w in c.walls)) for c in found.connections)
    for pair, n in (wanted - got).items():
        kinds = [c["shape"] for c in truth["connections"] if tuple(sorted(c["walls"])) == pair]
        causes.append(f"connection of walls {pair} missing {n} (there: {', '.join(kinds)})")
    causes += [f"connection of walls {pair} too many {n}" for pair, n in (got - wanted).items()]
    gaps = compare_gaps(found, place, truth, causes)
    profiles = compare_profiles(part, found, place, truth, causes)
    return {"walls": walls, "connections": wanted == got, "gaps": gaps, "profiles": profiles, "causes": causes,
            "right": walls and wanted == got and not causes, "connection_count": sum(wanted.values())}


def match_walls(part: Any, found: Any, walls: list[dict[str, Any]], causes: list[str]) -> dict[str, int]:
    """Which true wall each found one is: the one whose side points lie on its sides; -1 where there is none."""
    import numpy as np
    from trimesh.triangles import closest_point

    out: dict[str, int] = {}
    for wall in found.walls:
        t = part.mesh.triangles[np.isin(part.mesh.face_ids, wall.sides)]
        low, high = t.reshape(-1, 3).min(axis=0) - NEAR, t.reshape(-1, 3).max(axis=0) + NEAR
        hits = []
        for k, true in enumerate(walls):
            points = [np.array(q) for q in true["side_points"]]
            if not all(((q >= low) & (q <= high)).all() for q in points):
                continue
            far = max(np.linalg.norm(closest_point(t, np.tile(q, (len(t), 1))) - q, axis=1).min() for q in points)
            if far < NEAR:
                hits.append(k)
        out[wall.id] = hits[0] if len(hits) == 1 else -1
        if len(hits) != 1:
            size = f"{wall.thickness:.2f} thick, z {wall.z_bottom:.2f} to {wall.z_top:.2f}, {len(wall.faces)} faces"
            causes.append(f"{wall.id} is {'no true wall' if not hits else f'true walls {hits}'} ({size})")
    return out


def compare_gaps(found: Any, place: dict[str, int], truth: dict[str, Any], causes: list[str]) -> list[int]:
    """Right and total of the primary gaps, then of those among them that are no wider than ``NARROW``."""
    measured: dict[tuple[int, ...], float] = {}
    for c in found.channels:
        pair = tuple(sorted(place[w] for w in c.walls))
        measured[pair] = min(c.gap_min, measured.get(pair, c.gap_min))
    out = [0, 0, 0, 0]
    for channel in truth["channels"]:
        if not channel["primary"]:
            continue
        true, gap = channel["gap_min"], measured.get(tuple(sorted(channel["walls"])))
        right = gap is not None and abs(gap - true) <= GAP_TOLERANCE * true
        out[0] += right
        out[1] += 1
        if true <= NARROW:
            out[2] += right
            out[3] += 1
        if not right:
            said = "not found" if gap is None else f"{gap:.4f}"
            where = "on the border" if channel["border"] else "inside"
            causes.append(f"gap of walls {channel['walls']} {said}, true {true:.4f} at {channel['at']} {where}")
    return out


def compare_profiles(
    part: Any, found: Any, place: dict[str, int], truth: dict[str, Any], causes: list[str]
) -> dict[str, list[int]] | None:
    """Right and total of the profile types of wall sides by true type; None where the program has no classifier."""
    try:
        from zones.plan_view.profile_types import classify
        from zones.plan_view.wall_sections import wall_sections
    except ImportError:
        return None
    import numpy as np
    from shapely.geometry import LineString, Point

    by_side: dict[tuple[int, int], Any] = {}
    for curve in wall_sections(part, found):
        k = place.get(curve.wall, -1)
        if k < 0:
            continue
        points = [np.array(q[:2]) for q in truth["walls"][k]["side_points"]]
        line = LineString(np.vstack([curve.points, curve.points[:1]]) if curve.closed else curve.points)
        side = int(np.argmin([line.distance(Point(q)) for q in points]))
        old = by_side.get((k, side))
        if old is None or _length(curve.points) > _length(old.points):
            by_side[k, side] = curve
    out: dict[str, list[int]] = {}
    for k, wall in enumerate(truth["walls"]):
        for side, label in enumerate(wall["profiles"]):
            name = str(label or "straight")
            tally = out.setdefault(name, [0, 0])
            tally[1] += 1
            curve = by_side.get((k, side))
            said = classify(curve.points, curve.closed) if curve is not None else None
            answer = "no section" if said is None else (said.type.name if said.type is not None else "straight")
            if answer == name:
                tally[0] += 1
            else:
                margin = "" if said is None else f", margin {said.margin:.2f}"
                causes.append(f"profile of wall {k} {'left' if side == 0 else 'right'} {answer}, true {name} "
                              f"(drawn {wall['drawn']}){margin}")
    return out


def _length(points: Any) -> float:
    import numpy as np

    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def ask(recipe: str, seed: int, out: Path, limit: float) -> dict[str, Any]:
    """The judgement of one part from the cache or from a child process."""
    kept = out / "cache" / f"judged-{digest_of(SOURCES['judge'])}" / f"{recipe}-{seed}.json"
    if kept.exists():
        return dict(json.loads(kept.read_text()))
    command = [sys.executable, "-m", "benchmarks.reach.family_score", "--one", f"{recipe}:{seed}", "--out", str(out),
               "--limit", str(limit)]
    env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    begin = time.perf_counter()
    try:
        done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=limit)
        text = done.stdout.strip().splitlines()
        if done.returncode == 0 and text:
            result = json.loads(text[-1])
        else:
            last = (done.stderr.strip().splitlines() or ["no word"])[-1]
            result = {"error": f"{last} (exit {done.returncode})"}
    except subprocess.TimeoutExpired:
        result = {"error": f"no answer in {limit:g} s"}
    if "error" in result:
        result |= {"seed": seed, "recipe": recipe, "right": False, "causes": [result["error"]], "features": [],
                   "seconds": {"all": round(time.perf_counter() - begin, 1)}}
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(result))
    return result


def table(results: list[dict[str, Any]]) -> str:
    """Right and total over all parts, by feature and by profile type, then the seconds."""
    judged = [r for r in results if "error" not in r]
    lines = [f"{len(results)} parts, {len(results) - len(judged)} without answer"]
    for key in ("walls", "connections"):
        lines.append(f"{key + ' exact':24}{sum(r[key] for r in judged):6} of {len(results)}")
    both = sum(r["walls"] and r["connections"] for r in judged)
    lines.append(f"{'both':24}{both:6} of {len(results)}")
    gaps = [r["gaps"] for r in judged]
    for name, k in (("primary gaps", 0), (f"  up to {NARROW:g} mm", 2)):
        lines.append(f"{name:24}{sum(g[k] for g in gaps):6} of {sum(g[k + 1] for g in gaps)}")
    types: dict[str, list[int]] = {}
    for r in judged:
        for name, (right, total) in (r["profiles"] or {}).items():
            tally = types.setdefault(name, [0, 0])
            tally[0], tally[1] = tally[0] + right, tally[1] + total
    if any(r["profiles"] is None for r in judged):
        lines.append("profile types not asked: the program has no classifier")
    else:
        right, total = (sum(t[k] for t in types.values()) for k in (0, 1))
        lines.append(f"{'profile types':24}{right:6} of {total}")
    for name in sorted(types, key=lambda n: (len(n), n)):
        lines.append(f"  {name:22}{types[name][0]:6} of {types[name][1]}")
    lines.append("parts with walls and connections exact, by feature")
    features = Counter(f for r in judged for f in r["features"])
    good = Counter(f for r in judged for f in r["features"] if r["walls"] and r["connections"])
    lines += [f"  {name:22}{good[name]:6} of {features[name]}" for name in sorted(features)]
    for key in ("make", "read", "decompose"):
        s = sorted(r["seconds"].get(key, 0.0) for r in judged)
        if s:
            lines.append(f"{'seconds to ' + key:24}median {s[len(s) // 2]:.1f}, longest {s[-1]:.1f}")
    return "\n".join(lines)


def main() -> None:
    """Score a range of seeds, or judge one part for that."""
    parser = argparse.ArgumentParser(description="score the decomposition on the public family")
    parser.add_argument("--seeds", default="0:40", help="from:to, the end not included")
    parser.add_argument("--recipe", default="mixed")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--limit", type=float, default=300.0, help="seconds a part")
    parser.add_argument("--out", type=Path, default=Path("out/family_score"))
    parser.add_argument("--one", default=None, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        recipe, seed = args.one.rsplit(":", 1)
        print(json.dumps(judge(recipe, int(seed), args.out / "cache", args.out / "pictures", args.limit)))
        return
    first, last = (int(s) for s in args.seeds.split(":"))
    with ThreadPoolExecutor(args.jobs) as pool:
        work = [pool.submit(ask, args.recipe, seed, args.out, args.limit) for seed in range(first, last)]
        results = []
        for job in work:
            results.append(job.result())
            r = results[-1]
            said = "right" if r["right"] else "; ".join(r["causes"])
            print(f"{r['recipe']}-{r['seed']}: {said}", file=sys.stderr, flush=True)
    args.out.mkdir(parents=True, exist_ok=True)
    text = table(results)
    (args.out / "table.txt").write_text(text + "\n")
    (args.out / "failures.txt").write_text("".join(
        f"{r['recipe']}-{r['seed']} [{' '.join(r['features'])}]: {'; '.join(r['causes'])}\n"
        for r in results if not r["right"]))
    print(text)


if __name__ == "__main__":
    main()
