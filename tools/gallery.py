"""Render every scene and write the page that shows them: docs/gallery.md and its pictures.

python tools/gallery.py --seconds 300 --store renders
python tools/gallery.py --seconds 300 --store renders --only crystal    # goes on where it stopped

Each scene is rendered until its error without the worst 0.1 % of the pixels (noise, and blur of
photons) is small enough or its time is over. What --store holds is gone on from.
Rows of scenes that are not rendered again stay as they are.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import imageio.v3 as imageio

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.cli.scene_file import load_script
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.units import passes_in_words, per_cent
from hybrid_rt.sensor.color import screen_pixels
from meshing.outputs import make_folder, replacing

ROOT = Path(__file__).parents[1]
PAGE, PICTURES, RECORD = "gallery.md", "gallery", "gallery.json"
# First on the page, and rendered first; all others follow by name.
FIRST = ("crystal", "light_box", "still_life", "rings", "nurbs_goblet", "wine_glass", "cornell_box")
# Stops, of scenes whose lamps are set for figures and not for the eye.
EXPOSURE = {
    "caustic_ball": 2.0,
    "caustic_through_glass": 2.0,
    "glass_lathe": 1.0,
    "wine_glass": 0.7,
}
# Scenes whose script names paths, but which photons show with less noise in as much time: 7.1 % and 8.0 %
# without the worst 0.1 % of the pixels (320 wide, 10 s). Not still_life (8.2 and 8.5 %, and blurred by
# photons), cornell_box (7.4 and 4.8 %) and teapot_room (7.1 and 6.3 %).
BY_PHOTONS = ("rings",)
# Photons of a pass where caustics are what the picture is about; elsewhere a quarter of a pass's time.
PHOTONS = {"light_box": 4_000_000}
OTHER_PHOTONS = 2_000_000
# Where the blur is far below the noise: slower shrinking takes from the noise more than it adds. teapot_ppm: 2.5 instead
# of 2.9 % for a blur of 0.5 instead of 0.4 % (320 wide, 48 passes); wine_glass, with 0.92: 3.0 instead of 3.9 % for 1.6
# instead of 1.4 % (320 wide, 32 passes of 200 000 photons).
ALPHA = {"teapot_ppm": 0.85, "wine_glass": 0.9}
# Lossy: no difference is seen at this quality, and a picture takes a tenth of a PNG.
QUALITY = 90
HEAD = """# Gallery

Every scene of the project, rendered by `tools/gallery.py`, at most 1280 pixels wide or high. Below each image stands what it
cost in processor time and how far it may be off: the *noise* is the relative RMSE, first without [the worst 0.1 % of
the pixels](howto/noise.md#the-worst-01--of-the-pixels), then, in brackets, with them. Where photons are gathered their
*blur*, or a limit to it, follows. Nothing is denoised.
"""


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=300.0, help="for each scene, at most")
    parser.add_argument(
        "--error", type=float, default=0.01, help="that is enough; default 0.01, one per cent"
    )
    parser.add_argument("--width", type=one_or_more, default=1280, help="of the longer side")
    parser.add_argument("--threads", type=one_or_more, default=4)
    scenes = {script.stem: script for script in sorted((ROOT / "scenes").glob("*.py"))}
    parser.add_argument(
        "--only", action="append", choices=scenes, metavar="NAME", help="may be repeated"
    )
    parser.add_argument(
        "--store", type=Path, metavar="DIR", help="holds a folder of each scene, to go on from"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "docs")
    args = parser.parse_args()
    make_folder(args.out / PICTURES)
    record_file = args.out / PICTURES / RECORD
    record = json.loads(record_file.read_text("utf-8")) if record_file.exists() else {}
    with kept(record_file, lambda: record):
        for name in args.only or sorted(scenes, key=place):
            record[name] = show(scenes[name], args)
            print(row(name, record[name]), flush=True)
            write_page(args.out, record)
    return 0


def write_page(out: Path, record: dict[str, Any]) -> None:
    """Write the page: the scenes in their order, after the first one the strip and the parts, if they are there."""
    sections = [section(name, record[name]) for name in sorted(record, key=place)]
    for name, section_of in (("parts", parts_section), ("strip", strip_section)):
        facts = out / PICTURES / f"{name}.json"
        if facts.exists():
            sections.insert(1, section_of(json.loads(facts.read_text("utf-8"))))
    with replacing(out / PAGE) as file:
        file.write((HEAD + "".join(f"\n{text}" for text in sections)).encode())


def place(name: str) -> tuple[int, str]:
    """Return by what scenes are sorted."""
    return FIRST.index(name) if name in FIRST else len(FIRST), name


def show(script: Path, args: argparse.Namespace) -> dict[str, Any]:
    """Render one scene; return what the page says of it."""
    text = script.read_text("utf-8")
    scene, integrator = load_script(script)
    camera = scene.camera
    scale = args.width / max(camera.width, camera.height)
    width, height = (max(round(side * scale), 1) for side in (camera.width, camera.height))
    sized = scene.with_camera(camera.resized(width, height))
    if script.stem in BY_PHOTONS:
        integrator = "ppm"
    options = None
    if integrator == "ppm":
        alpha = ALPHA.get(script.stem, PPMOptions.alpha)
        options = PPMOptions(PHOTONS.get(script.stem, OTHER_PHOTONS), alpha)
    render(scene.with_camera(camera.resized(8, 6)), integrator, 1)  # compiles
    store = None if args.store is None else args.store / script.stem
    spent = 0.0 if store is None else spent_on(store)
    begin = time.process_time()
    try:
        result = render(
            sized,
            integrator,
            time_budget=args.seconds,
            target_error_trimmed=args.error,
            threads=args.threads,
            coarse="none",  # the same bits as by way of Embree, sooner
            options=options,
            store=store,
            resume=store is not None,
        )
    finally:  # also where Ctrl-C ends it: the store holds what was paid for
        spent += time.process_time() - begin
        if store is not None:
            spent_on(store, spent)
    stops = EXPOSURE.get(script.stem, 0.0)
    picture = args.out / PICTURES / f"{script.stem}.webp"
    pixels = screen_pixels(result.image, stops)
    with replacing(picture) as file:
        imageio.imwrite(file, pixels, extension=".webp", quality=QUALITY, method=6)
    report = result.report
    photons, noise = report.photons, report.noise
    return {
        "about": text.split('"""')[1].split("\n")[0],
        "integrator": integrator,
        "size": [width, height],
        "passes": report.passes,
        "photons": photons and photons.per_pass,
        "alpha": ALPHA.get(script.stem),
        "processor_seconds": round(spent, 1),
        "noise": noise and noise.relative_rmse,
        "noise_trimmed": noise and noise.relative_rmse_trimmed,
        "blur": photons and photons.blur_relative_rmse,
        "blur_at_most": photons and photons.blur_relative_rmse_at_most,
        "exposure": stops,
    }


def spent_on(store: Path, seconds: float | None = None) -> float:
    """Return the processor seconds of the passes in a store; write them first if they are given."""
    file = store.with_suffix(".seconds")
    if seconds is not None:
        with replacing(file) as opened:
            opened.write(repr(seconds).encode())
    # A store that was deleted begins anew.
    return float(file.read_text("utf-8")) if file.exists() and store.exists() else 0.0


def row(name: str, facts: dict[str, Any]) -> str:
    """Put the facts of one picture into a line."""
    passes = passes_in_words(facts["passes"])
    if facts["photons"]:
        passes += f" of {facts['photons']:,} photons"
        if facts.get("alpha"):
            passes += f" with alpha {facts['alpha']:g}"
    if facts["noise"] is None:
        noise = "noise unknown after one pass"
    else:
        noise = f"noise {per_cent(facts['noise_trimmed'])} ({per_cent(facts['noise'])})"
    if facts["blur"] is not None:
        noise += f", blur {per_cent(facts['blur'])}"
    elif facts["blur_at_most"] is not None:
        noise += f", blur at most {per_cent(facts['blur_at_most'])}"
    stops = ""
    if facts["exposure"]:
        unit = "stop" if facts["exposure"] == 1.0 else "stops"
        stops = f", shown {facts['exposure']:g} {unit} brighter"
    return (
        f"`scenes/{name}.py`: `{facts['integrator']}`, {passes}, "
        f"{facts['processor_seconds']:.0f} s; {noise}{stops}"
    )


def section(name: str, facts: dict[str, Any]) -> str:
    """Put one picture on the page."""
    return f"## {facts['about'].removesuffix('.')}\n\n![{name}](gallery/{name}.webp)\n\n{row(name, facts)}\n"


def strip_section(panels: list[dict[str, Any]]) -> str:
    """Put the caustic of meshes and of the true surface on the page, with a table of its panels."""
    text = (
        "## The caustic of that glass by two meshes, and exact, in equal processor time\n\n"
        "![strip](gallery/strip.webp)\n\n"
        "| | triangles | passes | processor s | noise | difference from exact |\n"
        "| --- | --- | --- | --- | --- | --- |\n"
    )
    for panel in panels:
        name, use = "exact", " that propose hits"
        if panel["accuracy"] == "mesh":
            name, use = f"mesh, tolerance {panel['tolerance']:g}", ""
        text += (
            f"| {name} | {panel['triangles']:,}{use} | {panel['passes']} | "
            f"{panel['processor_seconds']:.0f} | {per_cent(panel['noise_trimmed'])} | "
            f"{per_cent(panel['difference']) if panel['difference'] else ''} |\n"
        )
    return text + (
        "\n`tools/mesh_or_exact.py`: `scenes/crystal.py` from close by. Tolerances are in scene units; the "
        "glass is 3.3 high.\nDifference: relative RMSE of the means over 8 x 8 pixels, in which noise mostly "
        "averages out. More passes remove the\nnoise of all three, and none of what the facets do.\n"
    )


def parts_section(facts: dict[str, Any]) -> str:
    """Put the picture of a CAD part on the page."""
    (low, high), unit, limit = facts["thickness"], facts["unit"], facts["deviation"]
    return (
        "## A NIST part from its STEP file: the thickness of its walls; bent, and measured against the file\n\n"
        "![parts](gallery/parts.webp)\n\n"
        f"Left: from {low:.3g} (red) to {high:.3g} {unit} (blue), by a certified ray from each pixel; grey: no "
        "wall opposite\n([part reports](howto/part.md)). "
        f"Right: signed distances from {-limit:.2g} (blue) to {limit:.2g} {unit} (red), each with a proven\n"
        f"bound ([deviations](howto/deviation.md)). `tools/part_pictures.py` drew them from `{facts['model']}`.\n"
    )


if __name__ == "__main__":
    sys.exit(run_tool(main))
