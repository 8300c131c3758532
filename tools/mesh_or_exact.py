"""Show one caustic of meshes and of the true surface, in equal processor time: docs/gallery/strip.webp.

python tools/mesh_or_exact.py --seconds 120

The caustic of scenes/crystal.py, seen from close by, with accuracy="mesh" on two meshes and with
certified hits. Beside the picture, strip.json says what each panel took; tools/gallery.py puts both
on its page.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
from numpy.typing import NDArray

from hybrid_rt import Camera, PPMOptions, Scene
from hybrid_rt.cli.command import one_or_more, run_tool
from hybrid_rt.cli.scene_file import load_scene
from hybrid_rt.core.records import FloatArray
from hybrid_rt.rendering.renderer import RenderResult, render
from hybrid_rt.sensor.color import screen_pixels
from meshing.outputs import check_writable, make_folder, replacing

ROOT = Path(__file__).parents[1]
# (accuracy, tolerance of the mesh in scene units); the bowl of the glass is 2 across.
PANELS = (("mesh", 1e-2), ("mesh", 1e-3), ("certified", None))
# Pixels between the panels, and the side of the blocks whose means are compared.
GAP, BLOCK, QUALITY = 8, 8, 90


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=120.0, help="processor time of a panel")
    parser.add_argument("--width", type=one_or_more, default=480, help="of a panel; default 480")
    parser.add_argument("--photons", type=one_or_more, default=4_000_000, help="of a pass")
    parser.add_argument("--threads", type=one_or_more, default=4)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "gallery")
    args = parser.parse_args()
    make_folder(args.out)
    for name in ("strip.webp", "strip.json"):
        check_writable(args.out / name)
    close = Camera(
        look_from=(1.1, -9.0, 5.9),
        look_at=(1.05, -1.9, 0.0),
        up=(0.0, 0.0, 1.0),
        vertical_fov=8.5,
        width=args.width,
        height=round(0.75 * args.width),
    )
    scene = load_scene(ROOT / "scenes" / "crystal.py").with_camera(close)
    results, record = [], []
    for accuracy, tolerance in PANELS:
        result, seconds = panel(scene, accuracy, tolerance, args)
        results.append(result)
        record.append(facts(accuracy, tolerance, result, seconds))
        print(record[-1], flush=True)
    truth = blocks(results[-1].image)
    for entry, result in zip(record, results, strict=True):
        gap = blocks(result.image) - truth
        entry["difference"] = float(np.sqrt((gap**2).mean() / (truth**2).mean()))
    white = np.full((close.height, GAP, 3), 255, np.uint8)
    parts = [part for result in results for part in (white, screen_pixels(result.image))]
    strip = np.concatenate(parts[1:], axis=1)
    with replacing(args.out / "strip.webp") as file:
        imageio.imwrite(file, strip, extension=".webp", quality=QUALITY, method=6)
    with replacing(args.out / "strip.json") as file:
        file.write(f"{json.dumps(record, indent=1)}\n".encode())
    return 0


def panel(
    scene: Scene, accuracy: str, tolerance: float | None, args: argparse.Namespace
) -> tuple[RenderResult, float]:
    """Render as many passes as take the processor time; return the picture and the time that it took.

    What a render does once, as to tessellate, is taken from renders of one pass and of two.
    """

    def run(passes: int) -> tuple[RenderResult, float]:
        begin = time.process_time()
        result = render(
            scene,
            "ppm",
            passes,
            threads=args.threads,
            accuracy=accuracy,
            tolerance=tolerance,
            options=PPMOptions(args.photons),
        )
        return result, time.process_time() - begin

    small = scene.with_camera(scene.camera.resized(8, 6))
    render(small, "ppm", 1, accuracy=accuracy, tolerance=tolerance)  # compiles
    once, twice = run(1)[1], run(2)[1]
    of_a_pass = max(twice - once, 0.1 * once)
    # Of one pass alone the noise is unknown.
    return run(max(int((args.seconds - once) / of_a_pass) + 1, 2))


def facts(
    accuracy: str, tolerance: float | None, result: RenderResult, seconds: float
) -> dict[str, Any]:
    """Return what is said of a panel."""
    report = result.report
    noise, photons = report.noise, report.photons
    return {
        "accuracy": accuracy,
        "tolerance": tolerance,
        "triangles": report.coarse.triangles,
        "passes": report.passes,
        "photons": photons and photons.per_pass,
        "processor_seconds": round(seconds, 1),
        "noise_trimmed": noise and noise.relative_rmse_trimmed,
    }


def blocks(image: NDArray[np.floating]) -> FloatArray:
    """Return the means of blocks of pixels, clipped at white."""
    rows, columns = (side // BLOCK for side in image.shape[:2])
    shown = np.minimum(image[: rows * BLOCK, : columns * BLOCK].astype(np.float64), 1.0)
    means: FloatArray = shown.reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3))
    return means


if __name__ == "__main__":
    sys.exit(run_tool(main))
