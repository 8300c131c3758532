"""Show a CAD part by its wall thickness, and a scan of it by its deviation, for docs/gallery.md.

python tools/part_pictures.py part.step

Every pixel is a certified ray. The left half colours the thickness that a second ray measures. For the
right one the points that pixels see are moved as if the part were bent, and each is measured against
the model as a scanned point is. Beside the picture, parts.json says what the colours mean;
tools/gallery.py puts both on its page.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np

from hybrid_rt import Camera, ClosestPoint, read_cad
from hybrid_rt.cli.command import run_tool
from hybrid_rt.distance import measure
from hybrid_rt.distance.deviation import colors_of
from hybrid_rt.part.pictures import FOV, HEIGHT, LOOK, WIDTH, pictures
from hybrid_rt.part.report import surfaces_of_part
from hybrid_rt.part.walls import Walls
from meshing.outputs import check_writable, make_folder, replacing

ROOT = Path(__file__).parents[1]
QUALITY, MARGIN = 90, 16
# How far the middle of the bent part lies above its ends, over its size; the scale of colours ends there.
BENT = 1e-3


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("model", type=Path, metavar="part.step")
    parser.add_argument("--part", type=int, default=0, metavar="N", help="default 0, the first")
    parser.add_argument("--threads", type=int, help="default: all cores")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "gallery")
    args = parser.parse_args()
    make_folder(args.out)
    for name in ("parts.webp", "parts.json"):
        check_writable(args.out / name)
    model = read_cad(args.model)
    walls = Walls(surfaces_of_part(model, args.part)[0], np.deg2rad(20.0), args.threads)
    _, thickness, low, high = pictures(walls, [])
    deviation, limit = bent(walls)
    facts: dict[str, Any] = {
        "model": args.model.name,
        "unit": model.report["unit"],
        "thickness": [low, high],
        "deviation": limit,
    }
    drawn = np.argwhere((thickness < 250).any(axis=2))
    (top, left), (bottom, right) = drawn.min(axis=0) - MARGIN, drawn.max(axis=0) + MARGIN
    part = slice(max(top, 0), bottom), slice(max(left, 0), right)
    with replacing(args.out / "parts.webp") as file:
        both = np.hstack([thickness[part], deviation[part]])
        imageio.imwrite(file, both, extension=".webp", quality=QUALITY, method=6)
    with replacing(args.out / "parts.json") as file:
        file.write(json.dumps(facts, indent=1).encode())
    return 0


def bent(walls: Walls) -> tuple[Any, float]:
    """Return a picture of what pixels see of a bent part, measured against the part, and its limit."""
    low, high = walls.solid.box
    middle, limit = 0.5 * (low + high), BENT * walls.size
    forward = np.array(LOOK) / np.linalg.norm(LOOK)
    eye = middle - 1.9 * walls.size * forward
    camera = Camera(eye, middle, up=(0, 0, 1), vertical_fov=FOV, width=2 * WIDTH, height=2 * HEIGHT)
    row, column = np.indices((camera.height, camera.width)).reshape(2, -1)
    origins, way = camera.rays(column + 0.5, row + 0.5)
    hits = walls.tracer.intersect(origins, way)
    seen = np.flatnonzero(hits.hit & hits.front_face)
    points = hits.position[seen]
    along = int(np.argmax(high - low))
    across = 2 if along != 2 else 0
    share = 2.0 * (points[:, along] - middle[along]) / (high - low)[along]
    points[:, across] += limit * (1.0 - 2.0 * share * share)
    search = ClosestPoint(walls.solid.surfaces, closed=np.ones(len(walls.solid.surfaces), np.bool_))
    value = measure(search, points).deviation
    facing = np.abs((hits.normal[seen] * way[seen]).sum(axis=1))
    image = np.full((len(way), 3), 255.0)
    image[seen] = (0.45 + 0.55 * facing)[:, None] * colors_of(value, limit)
    image = image.reshape(HEIGHT, 2, WIDTH, 2, 3).mean(axis=(1, 3))
    return np.clip(image + 0.5, 0, 255).astype(np.uint8), limit


if __name__ == "__main__":
    sys.exit(run_tool(main))
