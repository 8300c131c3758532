"""Faces, exactness and speed of CAD files, beside OpenCASCADE, on one thread: a table, a row a file.

python tools/bench_cad.py FOLDER [--rays 200000] [--theirs 2000] [--out cad.json]

Rays aim at random points of the model's box from a sphere around it. OpenCASCADE is asked for its nearest
hit (IntCurvesFace_ShapeIntersector) at the first of them; rounds of both take turns. Times are processor
seconds. "same": rays for which both find the same t within 1e-6 of the size.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt import Intersector, read_cad
from hybrid_rt.cad.process import SUFFIXES
from hybrid_rt.cli.command import kept, one_or_more, run_tool, say
from hybrid_rt.core.records import FloatArray

ROUNDS = 3
HEADER = (
    f"{'file':34} {'faces':>6} {'exact':>7} {'refused':>7} {'build s':>8} {'k rays/s':>9} {'OCP':>7} {'ratio':>6} "
    f"{'same':>8} {'largest gap':>11}"
)


def rays_at(box: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Return rays from a sphere around a box to random points in it."""
    rng = np.random.default_rng(7)
    low, high = box
    out = rng.normal(size=(n, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    origins = 0.5 * (low + high) + np.linalg.norm(high - low) * out
    ways = low + (high - low) * rng.random((n, 3)) - origins
    return origins, ways / np.linalg.norm(ways, axis=1)[:, None]


def theirs_of(file: Path, millimetres: float) -> Any:
    """Return a function that traces rays by OpenCASCADE, which reads STEP files in mm."""
    from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
    from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_Reader

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    reader = STEPControl_Reader()
    reader.ReadFile(str(file))
    reader.TransferRoots()
    meet = IntCurvesFace_ShapeIntersector()
    meet.Load(reader.OneShape(), 1e-7)

    def trace(origins: FloatArray, directions: FloatArray) -> FloatArray:
        t = np.full(len(origins), np.inf)
        for k, (o, d) in enumerate(
            zip((millimetres * origins).tolist(), directions.tolist(), strict=True)
        ):
            meet.PerformNearest(gp_Lin(gp_Pnt(*o), gp_Dir(*d)), 0.0, 1e100)
            if meet.NbPnt():
                t[k] = meet.WParameter(1) / millimetres
        return t

    return trace


def measured(file: Path, n: int, n_theirs: int) -> dict[str, Any]:
    """Return the figures of a file."""
    from hybrid_rt.cad.records import MM

    began = time.perf_counter()
    model = read_cad(file, refuse="skip")
    build = time.perf_counter() - began
    tracer = Intersector(model.surfaces, coarse="none", threads=1)
    origins, directions = rays_at(model.bounds, n)
    trace = (
        theirs_of(file, MM[model.report["unit"]])
        if file.suffix.lower() in (".step", ".stp")
        else None
    )
    tracer.intersect(origins[:100], directions[:100])  # kernels are there now
    ours, theirs, found = [], [], None
    for _ in range(ROUNDS):
        at = time.process_time()
        hits = tracer.intersect(origins, directions)
        ours.append(time.process_time() - at)
        if trace is not None:
            at = time.process_time()
            found = trace(origins[:n_theirs], directions[:n_theirs])
            theirs.append(time.process_time() - at)
    exactness = model.faces["exactness"]
    row: dict[str, Any] = {
        "file": file.name, "faces": len(exactness), "exact": float((exactness == "exact").mean()),
        "refused": int((exactness == "refused").sum()), "build_seconds": build,
        "rays_per_second": n / min(ours), "largest_gap": max((g["gap"] for g in model.report["gaps"]), default=0.0),
    }  # fmt: skip
    if found is not None:
        size = float(np.linalg.norm(np.ptp(model.bounds, axis=0)))
        mine = hits.t[:n_theirs]
        with np.errstate(invalid="ignore"):
            is_same = (mine == found) | (np.abs(mine - found) <= 1e-6 * size)
        row |= {"theirs_per_second": n_theirs / min(theirs), "same": float(is_same.mean())}
    return row


def line(row: dict[str, Any]) -> str:
    """Return a row of the table."""
    rate, theirs = row["rays_per_second"], row.get("theirs_per_second", np.nan)
    return (
        f"{row['file'][:34]:34} {row['faces']:6d} {100 * row['exact']:6.1f}% {row['refused']:7d} "
        f"{row['build_seconds']:8.1f} {rate / 1e3:9.0f} {theirs / 1e3:7.2f} {rate / theirs:6.0f} "
        f"{100 * row.get('same', np.nan):7.2f}% {row['largest_gap']:11.2g}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rays", type=one_or_more, default=200_000)
    parser.add_argument("--theirs", type=one_or_more, default=2000, help="rays for OpenCASCADE")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    files = sorted(f for f in options.folder.iterdir() if f.suffix.lower() in SUFFIXES)
    if not files:
        raise ValueError(
            f"{options.folder} holds no CAD files: pass a folder of {', '.join(SUFFIXES)}"
        )
    rows: list[dict[str, Any]] = []
    say(HEADER)
    with kept(options.out, lambda: rows):
        for file in files:
            try:
                rows.append(measured(file, options.rays, options.theirs))
                say(line(rows[-1]))
            except (ValueError, TimeoutError) as error:
                say(f"{file.name}: {error}")


if __name__ == "__main__":
    sys.exit(run_tool(main))
