"""Draw docs/images/plan-view.svg and docs/images/zones-NAME.png: cells of the plan view, and zones in colours.

Run from the root of the repository: python docs/figures/zone_pictures.py. The parts are of the public family; what is
drawn is what the program computes.
"""

from __future__ import annotations

import colorsys
import json
import math
import tempfile
from pathlib import Path

import numpy as np
import shapely
from PIL import Image, ImageDraw

from examples.family.recipes import make_part
from geometry.mesh import F64
from geometry.trimming.facet_sheet import refined, sheet_of
from service.from_wire import parse_setup
from service.pictures.camera import Camera
from service.pictures.rasterizer import Canvas
from service.stages.preparation import Prepared, prepare
from zones.plan_view.channel_plan import ChannelPlan
from zones.zoning.zone_patches import Nearest
from zones.zoning.zones import ZoneArea

IMAGES = Path(__file__).resolve().parents[1] / "images"
SIZE, LINE = (1500, 900), 24
LIGHT = np.array([0.35, -0.5, 0.8])
REST = (0.80, 0.78, 0.76)
PARTS = (("demo", 0), ("impeller", 0))


def prepared(recipe: str, seed: int) -> Prepared:
    """The part of the family with its suggested setup, up to the zones."""
    made = make_part(seed, recipe)
    with tempfile.TemporaryDirectory() as folder:
        step, *_ = made.write(folder)
        return prepare(step, parse_setup(json.dumps(made.setup)), lambda _stage, _share: None)


def plan_view(plan: ChannelPlan, path: Path) -> None:
    """Cells of the plan view as SVG: channels by colour, walls grey, footprints hatched, trapezoids as thin lines."""
    map_, faces = plan.plan.map, plan.plan.faces
    corners, area = map_.corners(), plan.plan.over
    drawn = np.flatnonzero(area[faces.of_trapezoid].any(axis=1) & ~map_.flat)
    low, high = corners[drawn].reshape(-1, 2).min(axis=0) - 2, corners[drawn].reshape(-1, 2).max(axis=0) + 2
    scale = 900.0 / (high[0] - low[0])

    def at(p: F64) -> str:
        return " ".join(f"{(x - low[0]) * scale:.1f},{(high[1] - y) * scale:.1f}" for x, y in p)

    names = plan.plan.names
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 {(high[1] - low[1]) * scale:.0f}" '
           'font-family="sans-serif" font-size="15">']
    for k, name in enumerate(names):
        shape = plan.plan.shape(name)
        hue = 0.55 + 0.13 * k
        fill = {"W": "#8a8f98", "C": "#e8730c"}.get(name[0]) or "#" + "".join(
            f"{int(255 * c):02x}" for c in colorsys.hsv_to_rgb(hue % 1, 0.22, 0.95))
        for ring in shapely.get_parts(shape):
            out.append(f'<polygon points="{at(np.asarray(ring.exterior.coords))}" fill="{fill}" '
                       f'fill-opacity="{0.45 if name[0] == "C" else 1}" stroke="#333" stroke-width="0.8"/>')
    walls = " ".join(f"M{at(corners[t, [0]])}V{(high[1] - corners[t, 3, 1]) * scale:.1f}" for t in drawn)
    out.append(f'<path d="{walls}" fill="none" stroke="#000" stroke-opacity="0.18" stroke-width="0.4"/>')
    for name in names:
        shape = plan.plan.shape(name)
        p = shape.representative_point()
        out.append(f'<text x="{(p.x - low[0]) * scale:.0f}" y="{(high[1] - p.y) * scale + 5:.0f}" '
                   f'text-anchor="middle">{name}</text>')
    path.write_text("\n".join([*out, "</svg>"]) + "\n")


def colour(zone: ZoneArea, k: int) -> tuple[float, float, float]:
    """Orange shades for SCZI, other hues for SCZ; neighbours in the list differ."""
    if zone.kind == "SCZI":
        return colorsys.hsv_to_rgb(0.06 + 0.02 * (k % 3), 0.9 - 0.12 * (k % 4), 0.95)
    return colorsys.hsv_to_rgb((0.2 + 0.618034 * k) % 0.75 + 0.2, 0.35 + 0.12 * (k % 3), 0.82 + 0.05 * (k % 3))


def zones_picture(ready: Prepared, path: Path) -> None:
    """The part with every zone in its colour, the remainder grey, and a list."""
    view = ready.views[0]
    owner = np.zeros(len(view.samples), np.int64)
    for k, z in enumerate(ready.zones, start=1):
        owner[z.samples] = k
    sheet = refined(sheet_of(view.part, None), 0.3)
    corners = sheet.nodes[:, :3][sheet.corners]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    face = sheet.face[sheet.corners[:, 0]].astype(np.int32)
    label = Nearest(view, owner)(corners.mean(axis=1), normal, face)
    table = np.array([REST, *(colour(z, k) for k, z in enumerate(ready.zones))], dtype=np.float32)
    shade = 0.62 + 0.38 * np.clip(normal @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
    camera = Camera.fit(view.part.mesh.vertices, (2 * SIZE[0], 2 * SIZE[1]), azimuth=math.radians(-62),
                        elevation=math.radians(48))
    canvas = Canvas.blank(2 * SIZE[0], 2 * SIZE[1], (1.0, 1.0, 1.0))
    front = normal @ camera.basis[2] > 0
    canvas.triangles(camera.screen(corners[front]), (table[label[front]] * shade[front, None]).astype(np.float32),
                     label[front].astype(np.int32))
    canvas.outline((0.15, 0.15, 0.15), 8.0)
    rows = (len(ready.zones) + 3) // 3
    sheet_image = Image.new("RGB", (SIZE[0], SIZE[1] + LINE * rows + 20), "white")
    sheet_image.paste(Image.fromarray(canvas.halved()), (0, 0))
    pen = ImageDraw.Draw(sheet_image)
    lines = [(table[0], "remainder"), *((table[k], text(z)) for k, z in enumerate(ready.zones, start=1))]
    for k, (c, words) in enumerate(lines):
        x, y = 20 + SIZE[0] // 3 * (k // rows), SIZE[1] + 10 + LINE * (k % rows)
        pen.rectangle((x, y + 2, x + 16, y + 16), fill=tuple(int(255 * v) for v in c), outline="black")
        pen.text((x + 24, y), words, fill="black", font_size=15)
    sheet_image.save(path, optimize=True)


def text(zone: ZoneArea) -> str:
    """One line of the list: 'Z3 SCZ H1 steep T1 15.0 to 4.0 C1'."""
    profile = zone.category.profile
    return (f"{zone.id} {zone.kind} {zone.region} {zone.form} {zone.tool.id} {zone.top:.1f} to {zone.bottom:.1f}"
            + (f" {profile.type}" if profile and profile.type else ""))


def main() -> None:
    """Draw all of them."""
    for recipe, seed in PARTS:
        ready = prepared(recipe, seed)
        zones_picture(ready, IMAGES / f"zones-{recipe}.png")
        if recipe == PARTS[0][0]:
            plan_view(ChannelPlan.of(ready.views[0].part, ready.decomposition), IMAGES / "plan-view.svg")


if __name__ == "__main__":
    main()
