"""Are the stated errors true? For example: python tools/calibrate.py --seeds 400 --hits 1e6.

First noise: how often the truth falls into the stated 95 % intervals, over many seeds, per pixel
and for the mean of the picture. Of the small scenes of all kinds only pixels are judged, against the
mean of all renders: by paths after the most passes, by photons, which blur, after as many; "tiny
bright lamp" and "mirror cabinet", whose light is too rare, are measured only. Then the blur that
photons state, against floors of which the light is known without photons. Then certified hits of hard
rays before a screen and exact arithmetic, and some before exact arithmetic alone: whether t_bound was
ever exceeded, and how loose it is.

The exit code is 1 if a judged interval holds the truth less than 92 % of the time, or of pixels more
than 99 % (of means it may: where all rays may have missed a lamp it is wide), if a stated blur is off
by more than half of one that exceeds the noise, if the true blur is above its limit in more than 8 %
of the pictures, or if a bound is broken or loose.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.calibration import (
    PICTURES,
    Bounds,
    bounds,
    coverage,
)
from benchmarks.photon_truth import PHOTON_PICTURES, blur
from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from proof.cases.scenes import SCENES

LEAST, MOST_OF_PIXELS = 0.92, 0.99
HALF = 0.5
LOOSE = 64.0


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=400, help="for the noise; 0: none")
    parser.add_argument("--passes", type=one_or_more, nargs="+", default=[16, 64, 256])
    parser.add_argument(
        "--photon-passes",
        type=one_or_more,
        nargs="+",
        default=[16],
        help="of ppm; blur takes the first",
    )
    parser.add_argument(
        "--integrator",
        action="append",
        choices=("path", "whitted", "ppm", "photon_map"),
        help="default: path, ppm; may be repeated",
    )
    parser.add_argument(
        "--picture", action="append", choices=list(PICTURES), help="default: all; may be repeated"
    )
    parser.add_argument("--blur-seeds", type=int, default=40, help="0: none")
    parser.add_argument("--hits", type=float, default=1e5, help="shared by the scenes; 0: none")
    parser.add_argument("--exact-hits", type=float, default=1e4, help="by exact roots; 0: none")
    parser.add_argument("--threads", type=one_or_more, help="for blur and hits; noise takes one")
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    _check(args)
    pairs = _pairs(args) if args.seeds else []
    rows: list[dict[str, Any]] = []
    with kept(args.out, lambda: rows):
        for integrator, name in pairs:
            by_paths = integrator in {"path", "whitted"}
            counts = args.passes if by_paths else args.photon_passes
            truth = None
            # Paths are unbiased: the most passes know best what rare ones bring.
            for n in sorted(counts, reverse=True):
                row, mean_image = _cover(name, integrator, n, args.seeds, truth)
                rows.append(row)
                truth = mean_image if by_paths and truth is None else truth
        if args.blur_seeds:
            rows.extend(
                _blur(name, args.photon_passes[0], args.blur_seeds, args.threads)
                for name in PHOTON_PICTURES
            )
        for count, truth in ((args.hits, "screen"), (args.exact_hits, "exact roots")):
            share = -(-int(count) // len(SCENES))
            rows.extend(_bind(name, share, truth, args.threads) for name in SCENES if count)
    return 0 if all(row["honest"] for row in rows) else 1


def _check(args: argparse.Namespace) -> None:
    """Refuse what cannot be counted, and to check nothing."""
    seeds, hits = (args.seeds, args.blur_seeds), (args.hits, args.exact_hits)
    for option, n in zip(("--seeds", "--blur-seeds"), seeds, strict=True):
        checks.whole(n, option, at_least=0)
        if n == 1:
            raise ValueError(
                f"{option} is 1, which tells nothing of the noise: pass 2 or more, or 0"
            )
    for option, count in zip(("--hits", "--exact-hits"), hits, strict=True):
        checks.number(count, option, at_least=0.0)
    if not any((*seeds, *hits)):
        raise ValueError("there is nothing to check: pass --seeds, --blur-seeds or --hits above 0")


def _pairs(args: argparse.Namespace) -> list[tuple[str, str]]:
    """Return the integrators and the names of the pictures to make by them."""
    integrators, names = args.integrator or ["path", "ppm"], args.picture or list(PICTURES)
    kinds = {name: PICTURES[name]().integrators for name in PICTURES if name in names}
    pairs = [(one, name) for one in integrators for name in kinds if one in kinds[name]]
    if not pairs:
        known = "; ".join(f"{name!r} is by {' or '.join(kind)}" for name, kind in kinds.items())
        raise ValueError(
            f"no picture is by {' or '.join(integrators)}: {known}. Pass one of these as --integrator, or "
            "--seeds 0"
        )
    return pairs


def _cover(
    name: str, integrator: str, passes: int, n_seeds: int, truth: FloatArray | None
) -> tuple[dict[str, Any], FloatArray]:
    """Return the figures of a picture, and the mean of its renders."""
    picture = PICTURES[name]()
    found = coverage(picture, integrator, passes, range(n_seeds), truth)
    is_within = {
        "pixels": LEAST <= found.of_pixels <= MOST_OF_PIXELS,
        "means": found.of_mean >= LEAST,
    }
    honest = all(is_within[one] for one in picture.judged)
    remark = "" if picture.judged else "   (not judged)"
    if not honest:
        remark = "   NOT as often as stated"
    print(
        f"{name:20} {integrator:8} {passes:4d} passes, {n_seeds} seeds: inside the 95 % interval "
        f"{found.of_pixels:.1%} of pixels, {found.of_mean:.1%} of means; stated error over true "
        f"{found.error_ratio:.2f}{remark}",
        flush=True,
    )
    return {
        "picture": name, "integrator": integrator, "passes": passes, "seeds": n_seeds,
        "of_pixels": found.of_pixels, "of_mean": found.of_mean, "error_ratio": found.error_ratio,
        "honest": honest,
    }, found.mean_image  # fmt: skip


def _blur(name: str, passes: int, n_seeds: int, threads: int | None) -> dict[str, Any]:
    found = blur(PHOTON_PICTURES[name](), passes, range(n_seeds), threads)
    counts = found.true > found.noise
    honest = found.below_limit >= LEAST and (not counts or abs(found.ratio - 1.0) <= HALF)
    remark = "" if counts else "   (below the noise)"
    if not honest:
        remark += "   OFF BY MORE THAN HALF, OR ABOVE ITS LIMIT"
    print(
        f"{name:20} ppm      {passes:4d} passes, {n_seeds} seeds: blur {found.true:.3g}, noise "
        f"{found.noise:.3g}; stated blur over true {found.ratio:.2f}, within half of it in "
        f"{found.within_half:.0%} of pictures, below its limit in {found.below_limit:.0%}{remark}",
        flush=True,
    )
    return {
        "blur_of": name, "passes": passes, "seeds": n_seeds, "blur": found.true,
        "noise": found.noise, "ratio": found.ratio, "within_half": found.within_half,
        "below_limit": found.below_limit,
        "honest": honest,
    }  # fmt: skip


def _bind(name: str, n_hits: int, truth: str, threads: int | None) -> dict[str, Any]:
    parts: list[Bounds] = []
    # Not every ray hits: go on until there are enough.
    for part in bounds(SCENES[name](), 100 * n_hits, 1, threads, truth == "exact roots"):
        parts.append(part)
        if sum(len(p.looseness) for p in parts) >= n_hits:
            break
    looseness = np.concatenate([part.looseness for part in parts])
    hits, exceeded = len(looseness), sum(part.exceeded for part in parts)
    wrong = sum(part.wrong for part in parts)
    worst, median = max(part.worst for part in parts), float(np.median(looseness))
    honest = exceeded == 0 and wrong == 0 and median < LOOSE
    print(
        f"{name:20} {truth}: {hits:7d} hits, {wrong} wrong; t_bound exceeded {exceeded} times "
        f"(largest error {worst:.2f} of it); t_bound / (eps scale / |cos|): median {median:.1f}, 99 % "
        f"below {np.quantile(looseness, 0.99):.1f}{'' if honest else '   BROKEN OR LOOSE'}",
        flush=True,
    )
    return {
        "scene": name, "truth": truth, "hits": hits, "wrong": wrong, "exceeded": exceeded,
        "worst": worst, "looseness_median": median,
        "looseness_99": float(np.quantile(looseness, 0.99)), "honest": honest,
    }  # fmt: skip


if __name__ == "__main__":
    sys.exit(run_tool(main))
