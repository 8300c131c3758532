"""Write the list of what kernels are called with, from which a cold cache is filled.

python tools/list_kernels.py

To be run after a kernel, or what it is called with, has changed; a test says so. All kernels are
compiled anew for it, many of them several times: half an hour on two cores. With --again only the
seconds of what is listed are measured: some five minutes.
"""

import argparse
import functools
import inspect
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numba.core import event
from numba.core.registry import CPUDispatcher

from hybrid_rt import (
    Box,
    Intersector,
    Plane,
    Rectangle,
    Sphere,
    TriangleMesh,
    demo,
    render,
)
from hybrid_rt.analysis.mesh_comparison import compare_with_mesh
from hybrid_rt.cli.command import one_or_more, run_tool
from hybrid_rt.cli.scene_file import load_script
from hybrid_rt.core import precompile
from hybrid_rt.core.precompile import type_to_json
from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.intersection.kinds.registry import MANY, kernel_groups
from hybrid_rt.rendering.result import RenderResult
from meshing import BezierPatches, TrimmedSurface, circle
from meshing.kernels.cache import CacheOfParts, SharedCache, name_of
from proof.cases.campaign import SCENES as SURFACES_TO_JUDGE
from proof.cases.campaign import steps
from proof.judges.surface_judge import all_judges

SCENES = Path(__file__).parents[1] / "scenes"
# All of light and material between them.
RENDERED = ("still_life", "cornell_box", "teapot_room", "wine_glass")
# Few photons are enough to see what their kernels are called with.
OPTIONS: dict[str, Any] = {
    name: declared.with_settings({"photons": 2000} if declared.sends_photons else {})
    for name, declared in INTEGRATORS.items()
}
WAYS = {
    "certified": ("certified", "embree"),
    "alone": ("certified", "none"),
    "refined": ("refined", "embree"),
    "mesh": ("mesh", "embree"),
}


def main() -> int:
    """Run every case in a process of its own; or print what one of them needs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--case", action="append", choices=CASES, help="print what it needs")
    parser.add_argument("--again", action="store_true", help="measure what is listed, and sort it")
    rows = "print the seconds of every Nth entry of the list, from the Ith on"
    parser.add_argument("--rows", type=int, nargs=2, metavar=("I", "N"), help=rows)
    parser.add_argument("--jobs", type=one_or_more, default=os.cpu_count(), metavar="N")
    args = parser.parse_args()
    if args.case is not None:
        print(json.dumps(needed_for(args.case)))
        return 0
    if args.rows is not None:
        print(json.dumps(seconds_of_every(*args.rows)))
        return 0
    if args.again:
        entries = measured_again(args.jobs)
    else:
        with ThreadPoolExecutor(args.jobs) as pool:
            entries_of = pool.map(lambda case: in_a_process("--case", case), CASES)
            entries = merged(dict(zip(CASES, entries_of, strict=True)))
    Path(str(precompile.FILE)).write_text(as_text(entries), "utf-8")
    print(f"{precompile.FILE}: {len(entries)} compilations of {len(CASES)} groups")
    return 0


def surfaces_of(kind: str) -> list[Any]:
    """Return surfaces of one kind."""
    if kind.startswith(TRIMMED):
        loop = circle((0.5, 0.5), 0.45)
        kind = kind.removeprefix(TRIMMED)
        # Several patches have no common (u, v) to draw loops in.
        wholes = [any_patch(3, 3)] if kind == "bicubic patches" else surfaces_of(kind)
        return [TrimmedSurface(whole, [loop]) for whole in wholes]
    if kind.startswith(MANY_OF):
        one = surfaces_of(kind.removeprefix(MANY_OF))[0]
        return [one.transformed(moved(float(i))) for i in range(max(MANY.values()))]
    made: dict[str, Callable[[], Any]] = {
        "spheres": lambda: Sphere((0.0, 0.0, 0.0), 1.0),
        "rectangles": lambda: Rectangle((-1.0, -1.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0)),
        "planes": lambda: Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        "boxes": lambda: Box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)),
        "bicubic patches": demo.teapot,
        "Bezier patches": lambda: any_patch(4, 3),
        "rational bicubic patches": lambda: rational_patch(3, 3),
        "rational patches": lambda: rational_patch(2, 4),
        "revolutions": lambda: demo.vase(0.0, 0.0, 5.0),
        "meshes": lambda: TriangleMesh(trimesh.creation.icosphere(1)),
        **of_judges(),
    }
    found = made[kind]()
    return found if isinstance(found, list) else [found]


def of_judges() -> dict[str, Callable[[], Any]]:
    """Return the examples that judges bring of classes that do not go to Embree, by their kernels."""
    found: dict[str, Callable[[], Any]] = {}
    for judge in all_judges().values():
        for make in judge.examples.values():
            groups = kernel_groups(make(), "certified", "embree")
            if groups == kernel_groups(make(), "certified", "none"):
                found.update(dict.fromkeys(groups, make))
    return found


CLOSED = ("spheres", "rectangles", "boxes", *of_judges())
MANY_OF = "many "
PLAIN = ("planes", *CLOSED, *(MANY_OF + kind for kind in CLOSED))
FROM_EMBREE = (
    "bicubic patches", "Bezier patches", "rational bicubic patches", "rational patches",
    "revolutions", "meshes",
)  # fmt: skip
# What is seldom trimmed is compiled when it is met.
TRIMMED = "trimmed "
OF_TRIMMED = (
    "rectangles", "spheres", "tori", "aspheres", "bicubic patches, certified",
    "rational bicubic patches, certified", "rational patches, certified", "revolutions, certified",
)  # fmt: skip
OF_SURFACES = (
    *PLAIN,
    *(f"{kind}, {way}" for kind in FROM_EMBREE for way in WAYS),
    *(f"{MANY_OF}revolutions, {way}" for way in ("certified", "alone")),
    *(TRIMMED + kind for kind in OF_TRIMMED),
)
OF_PRODUCT = re.compile(r"(hybrid_rt|meshing)\b.*\.kernels\.")
# Of what these need, the kernels of surfaces are left to surfaces.
OTHERS = (*OPTIONS, "judges")
CASES = (*OF_SURFACES, *OTHERS)


def moved(x: float) -> FloatArray:
    """Return the matrix of a move along the first axis."""
    matrix = np.eye(4)
    matrix[0, 3] = 3.0 * x
    return matrix


def any_patch(degree_u: int, degree_v: int) -> BezierPatches:
    """Return a curved patch."""
    side_u, side_v = np.linspace(-1, 1, degree_u + 1), np.linspace(-1, 1, degree_v + 1)
    u, v = np.meshgrid(side_u, side_v, indexing="ij")
    return BezierPatches(np.stack([u, v, u * u - v * v * v], axis=-1)[None])


def rational_patch(degree_u: int, degree_v: int) -> BezierPatches:
    """Return a curved patch with weights."""
    side_u, side_v = np.linspace(-1, 1, degree_u + 1), np.linspace(-1, 1, degree_v + 1)
    u, v = np.meshgrid(side_u, side_v, indexing="ij")
    return BezierPatches([np.stack([u, v, u * u - v * v * v], axis=-1)], [1.0 + 0.2 * u * v])


def measured_again(jobs: int) -> list[dict[str, Any]]:
    """Return the list as it is, with new seconds, and sorted by them."""
    entries: list[dict[str, Any]] = json.loads(precompile.FILE.read_text("utf-8"))
    with ThreadPoolExecutor(jobs) as pool:
        ways = [("--rows", str(i), str(jobs)) for i in range(jobs)]
        for i, found in enumerate(pool.map(lambda way: in_a_process(*way), ways)):
            for entry, seconds in zip(entries[i::jobs], found, strict=True):
                entry["seconds"] = seconds
    return in_order(entries)


def seconds_of_every(first: int, step: int) -> list[float]:
    """Compile some of what is listed, and return the seconds of each."""
    watch, seconds = Watch(), []
    with event.install_listener("numba:compile", watch):
        for entry in precompile.read_list()[first::step]:
            kernel = precompile.named(entry.kernel)
            kernel.compile(tuple(map(precompile.type_from_json, entry.types)))
            seconds.append(round(watch.seconds_of(kernel), 1))
    return seconds


def needed_for(cases: list[str]) -> list[dict[str, Any]]:
    """Run cases; return the kernels they need, with the seconds of those compiled here."""
    precompile.read_list = list  # nobody compiles anything for this process
    watch = Watch()
    with event.install_listener("numba:compile", watch):
        for case in cases:
            if case in OF_SURFACES:
                run_rays(case)
            elif case in OPTIONS:
                run_renders(case)
            else:
                run_judges()
    return [
        {
            "kernel": name_of(kernel.py_func),
            "types": types,
            "seconds": watch.seconds_of(kernel),
            "parts": sorted(name_of(x.py_func) for x in linked_by(kernel)),
        }
        for kernel, types in overloads()
    ]


class Watch(event.Listener):  # type: ignore[misc]
    """Measures how long each function takes to compile, without those that it calls."""

    def __init__(self) -> None:
        self._seconds: dict[Any, float] = defaultdict(float)
        self._begins: list[float] = []
        self._of_others: list[float] = []

    def on_start(self, event: Any) -> None:
        """Note when a compilation begins."""
        del event
        self._begins.append(time.thread_time())
        self._of_others.append(0.0)

    def on_end(self, event: Any) -> None:
        """Note how long the compilation that began last took."""
        whole = time.thread_time() - self._begins.pop()
        function = event.data["dispatcher"].py_func
        self._seconds[function] = max(self._seconds[function], whole - self._of_others.pop())
        if self._of_others:
            self._of_others[-1] += whole

    def seconds_of(self, kernel: Any) -> float:
        """Return the seconds of a kernel if its parts are in the cache."""
        return sum(self._seconds[x.py_func] for x in compiled_with(kernel))


def linked_by(kernel: Any) -> set[Any]:
    """Return the parts that a kernel links, and those that they link."""
    return {x for x in reached_from(kernel, beyond_parts=True) - {kernel} if is_part(x)}


def compiled_with(kernel: Any) -> set[Any]:
    """Return the functions that are compiled with a kernel if its parts are in the cache."""
    return {kernel} | {x for x in reached_from(kernel, beyond_parts=False) if not is_part(x)}


def is_part(kernel: Any) -> bool:
    """Tell whether a function has a cache of its own for kernels that link it."""
    return isinstance(kernel._cache, CacheOfParts)


def reached_from(kernel: Any, beyond_parts: bool) -> set[Any]:
    """Return what a kernel calls, directly or not."""
    found: set[Any] = set()
    left = [kernel]
    while left:
        new = set(functions_in(left.pop().py_func)) - found
        found |= new
        left.extend(x for x in new if beyond_parts or not is_part(x))
    return found


@functools.cache
def functions_in(function: Any) -> list[Any]:
    """Return the compiled functions that a function names."""
    names = set(function.__code__.co_names)
    named = [function.__globals__.get(name) for name in names]
    in_modules = [getattr(m, name, None) for m in named if inspect.ismodule(m) for name in names]
    enclosed = [cell.cell_contents for cell in function.__closure__ or ()]
    return [x for x in (*named, *in_modules, *enclosed) if isinstance(x, CPUDispatcher)]


def run_rays(case: str) -> None:
    """Ask for first hits and shadows in all forms that kernels tell apart."""
    kind, _, way = case.partition(", ")
    surfaces, (accuracy, coarse) = surfaces_of(kind), WAYS[way or "certified"]
    assert case == kernel_groups(surfaces, accuracy, coarse)[-1]
    low, high = np.clip(surfaces[0].bounds, -10.0, 10.0)
    middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    rng = np.random.default_rng(1)
    start = middle + size * rng.normal(size=(20_000, 3))
    to = middle + 0.3 * size * rng.normal(size=start.shape) - start
    tracer = Intersector(surfaces, accuracy, coarse, threads=1)
    hits = tracer.intersect(start, to)
    found = hits[hits.hit]
    far = np.full(len(found), np.inf)
    tracer.intersect(found.position, to[: len(found)], source=found)
    tracer.occluded(found.position, to[: len(found)], far, source=found)
    tracer.occluded(start, to)


def run_renders(integrator: str) -> None:
    """Make small pictures of scenes with all sorts of lights and materials."""

    def small(scene: Any) -> RenderResult:
        camera = scene.camera.resized(48, 36)
        return render(
            scene.with_camera(camera), integrator, passes=2, threads=1, options=OPTIONS[integrator]
        )

    small(demo.scene())
    for name in RENDERED:
        small(load_script(SCENES / f"{name}.py")[0])
    if integrator == "whitted":  # as the demo does
        scene = demo.scene()
        compare_with_mesh(scene.with_camera(scene.camera.resized(48, 36)))


def run_judges() -> None:
    """Let hits be judged as `proof` does, which many tests ask for."""
    for surfaces in SURFACES_TO_JUDGE.values():
        next(steps(surfaces(), 40, seed=1, threads=1))


def overloads() -> list[tuple[Any, list[Any]]]:
    """Return the kernels and parts of this process, and what types they are compiled for."""
    found = []
    for module in [m for name, m in sys.modules.items() if OF_PRODUCT.match(name)]:
        for kernel in vars(module).values():
            if not isinstance(getattr(kernel, "_cache", None), SharedCache):
                continue
            for types in kernel.signatures if kernel.__module__ == module.__name__ else ():
                with suppress(TypeError):  # called by other kernels alone
                    found.append((kernel, [type_to_json(x) for x in types]))
    return found


def in_a_process(*options: str) -> Any:
    """Run this tool, with a cache of its own: a kernel that is loaded does not tell what it links."""
    print(*options, file=sys.stderr)
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, __file__, *options],
            env={**os.environ, "NUMBA_CACHE_DIR": folder},
            stdout=subprocess.PIPE,
            check=True,
        )
    return json.loads(done.stdout)


def merged(found: dict[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Name the groups of each compilation."""
    groups: dict[tuple[str, str], list[str]] = defaultdict(list)
    seconds: dict[tuple[str, str], float] = defaultdict(float)
    parts: dict[str, list[str]] = {}
    for case, entries in found.items():
        for entry in entries:
            key = entry["kernel"], json.dumps(entry["types"])
            if case in OTHERS and any(group in OF_SURFACES for group in groups[key]):
                continue
            groups[key].append(case)
            seconds[key] = max(seconds[key], entry["seconds"])
            parts[entry["kernel"]] = entry["parts"]

    return in_order(
        [
            {
                "kernel": key[0],
                "types": json.loads(key[1]),
                "groups": groups[key],
                "seconds": round(seconds[key], 1),
                **({"parts": parts[key[0]]} if parts[key[0]] else {}),
            }
            for key in groups
        ]
    )


def in_order(entries: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Sort a list: first what the longest work is waiting for."""

    @functools.cache
    def until_the_end(i: int) -> float:
        kernel = entries[i]["kernel"]
        after = [until_the_end(k) for k, x in enumerate(entries) if kernel in x.get("parts", ())]
        return float(entries[i]["seconds"]) + max(after, default=0.0)

    def rank(i: int) -> Any:
        return -until_the_end(i), entries[i]["kernel"], json.dumps(entries[i]["types"])

    return [entries[i] for i in sorted(range(len(entries)), key=rank)]


def as_text(entries: list[dict[str, Any]]) -> str:
    """Put a list into JSON, a line for each entry."""
    return "[\n" + ",\n".join(json.dumps(entry) for entry in entries) + "\n]\n"


if __name__ == "__main__":
    sys.exit(run_tool(main))
