"""Does a long render stay as it begins? For example: python tools/soak.py scenes/wine_glass.py.

Renders many passes and compares the memory and the processor time of the last hundred with those of
the first (the very first are left out: they fill caches and buffers). The exit code is 1 if memory grew by
more than a twentieth, or a pass costs more than a twentieth more than it did.
"""

import argparse
import resource
import sys
import time
from bisect import bisect_left
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.cli.scene_file import load_script
from hybrid_rt.integrators.workers import TOGETHER
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.result import RenderInterrupted

WARM, OVER = 10, 100
GROWTH = 0.05


@dataclass
class Log:
    """Progress that notes passes done, processor seconds and resident memory (MiB)."""

    n_pixels: int
    passes: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    memory: list[float] = field(default_factory=list)

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Note the state, at the ends of passes."""
        del total
        passes = done // self.n_pixels
        if stage != "Rendering" or (self.passes and passes == self.passes[-1]):
            return
        self.passes.append(passes)
        self.seconds.append(time.process_time())
        self.memory.append(_resident_mib())

    def over(self, first: int, last: int) -> dict[str, float]:
        """Return the seconds a pass and the largest memory between two numbers of passes, or so.

        Small passes are made many together, and progress is told when some thousand rays are done.
        """
        begin, end = (bisect_left(self.passes, n) for n in (first, last))
        begin, end = min(begin, len(self.passes) - 2), min(end, len(self.passes) - 1)
        begin = min(begin, end - 1)
        n = self.passes[end] - self.passes[begin]
        seconds = (self.seconds[end] - self.seconds[begin]) / n
        return {"seconds_a_pass": seconds, "mib": max(self.memory[begin : end + 1])}


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path)
    parser.add_argument("--integrator", help="default: the scene's")
    parser.add_argument("--passes", type=one_or_more, default=2000)
    parser.add_argument("--time-budget", type=float, help="seconds; the fewer passes of the two")
    parser.add_argument("--width", type=one_or_more, default=64)
    parser.add_argument("--threads", type=one_or_more)
    parser.add_argument("--store", type=Path, help="save the sums there as well")
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    scene, integrator = load_script(args.scene)
    scene = scene.with_camera(scene.camera.resized(args.width))
    height = scene.camera.height
    log = Log(args.width * height)
    figures: dict[str, Any] = {}
    with kept(args.out, lambda: figures):
        try:
            result = render(
                scene,
                args.integrator or integrator,
                args.passes,
                args.time_budget,
                threads=args.threads,
                progress=log,
                store=args.store,
            )
        except RenderInterrupted as interrupt:
            result = interrupt.result
        n = result.passes
        # Small passes are made many together: two such groups have filled all buffers.
        warm = max(WARM, 2 * TOGETHER // log.n_pixels)
        if n < warm + 2 * OVER:
            raise ValueError(f"{n} passes: too few to compare, pass {warm + 2 * OVER} or more")
        figures |= {
            "scene": str(args.scene),
            "width": args.width,
            "height": height,
            "passes": n,
            "seconds": result.seconds,
            "first": log.over(warm, warm + OVER),
            "last": log.over(n - OVER, n),
            "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10,
        }
    first, last = figures["first"], figures["last"]
    print(f"{n} passes of {args.width} x {height} in {figures['seconds']:.0f} s")
    print(f"{'':18}{'first hundred':>16}{'last hundred':>16}{'change':>10}")
    is_steady = True
    for name, key, scale in (("ms a pass", "seconds_a_pass", 1e3), ("memory, MiB", "mib", 1.0)):
        change = last[key] / first[key] - 1.0
        is_steady &= change <= GROWTH
        print(f"{name:18}{scale * first[key]:16.2f}{scale * last[key]:16.2f}{change:10.1%}")
    print("ms: of processor time, all threads; memory: resident, the most within the hundred")
    return 0 if is_steady else 1


def _resident_mib() -> float:
    """Return the memory that this process has at present."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


if __name__ == "__main__":
    sys.exit(run_tool(main))
