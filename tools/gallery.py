"""Render every scene and write the page that shows them: docs/gallery.md and its pictures.

python tools/gallery.py --seconds 30
python tools/gallery.py --only wine_glass --seconds 120

Each scene is rendered by the integrator that its script names first. Rows of scenes that are not
rendered again stay as they are.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.cli.scene_file import load_script
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.summary import passes_in_words

ROOT = Path(__file__).parents[1]
PAGE, PICTURES, RECORD = "gallery.md", "gallery", "gallery.json"
HEAD = """# Gallery

Every scene of the project, by `python tools/gallery.py`, on a busy machine. Error: root mean square
of the standard errors of all pixels, in units of radiance, from the differences between passes;
where photons are gathered, the estimated blur, or a limit to it, comes beside it. The pictures are
small, so that a page holds them; every script renders larger ones.
"""


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=30.0, help="for each scene")
    parser.add_argument("--width", type=one_or_more, default=360)
    parser.add_argument("--threads", type=one_or_more, default=4)
    scenes = {script.stem: script for script in sorted((ROOT / "scenes").glob("*.py"))}
    parser.add_argument(
        "--only", action="append", choices=scenes, metavar="NAME", help="may be repeated"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "docs")
    args = parser.parse_args()
    (args.out / PICTURES).mkdir(parents=True, exist_ok=True)
    record_file = args.out / PICTURES / RECORD
    record = json.loads(record_file.read_text("utf-8")) if record_file.exists() else {}
    with kept(record_file, lambda: record):
        for name in args.only or scenes:
            record[name] = show(scenes[name], args)
            print(row(name, record[name]), flush=True)
    page = HEAD + "".join("\n" + section(name, facts) for name, facts in sorted(record.items()))
    (args.out / PAGE).write_text(page, "utf-8")
    return 0


def show(script: Path, args: argparse.Namespace) -> dict[str, Any]:
    """Render one scene; return what the page says of it."""
    text = script.read_text("utf-8")
    scene, integrator = load_script(script)
    camera = scene.camera
    height = max(round(camera.height * args.width / camera.width), 1)
    small = scene.with_camera(camera.resized(args.width, height))
    render(scene.with_camera(camera.resized(8, 6)), integrator, 1)  # compiles
    result = render(small, integrator, time_budget=args.seconds, threads=args.threads)
    result.save(args.out / PICTURES / f"{script.stem}.png")
    (args.out / PICTURES / f"{script.stem}.json").unlink()
    report = result.report
    photons = report.get("photons")
    return {
        "about": text.split('"""')[1].split("\n")[0],
        "integrator": integrator,
        "size": [args.width, height],
        "threads": args.threads,
        "passes": report["passes"],
        "seconds": report["seconds"]["total"],
        "error": report["noise"] and report["noise"]["root_mean_square_standard_error_of_pixels"],
        "blur": photons and photons["blur_root_mean_square"],
        "blur_at_most": photons and photons["blur_root_mean_square_at_most"],
    }


def row(name: str, facts: dict[str, Any]) -> str:
    """Put the facts of one picture into a line."""
    error = "unknown after one pass" if facts["error"] is None else f"{facts['error']:.3g}"
    blur = "" if facts["blur"] is None else f", blur {facts['blur']:.2g}"
    if not blur and facts.get("blur_at_most") is not None:
        blur = f", blur at most {facts['blur_at_most']:.2g}"
    width, height = facts["size"]
    return (
        f"`scenes/{name}.py`: {facts['integrator']}, {width} x {height}, "
        f"{passes_in_words(facts['passes'])}, "
        f"{facts['seconds']:.1f} s on {facts['threads']} threads, error {error}{blur}"
    )


def section(name: str, facts: dict[str, Any]) -> str:
    """Put one picture on the page."""
    return f"## {facts['about']}\n\n![{name}](gallery/{name}.png)\n\n{row(name, facts)}\n"


if __name__ == "__main__":
    sys.exit(run_tool(main))
