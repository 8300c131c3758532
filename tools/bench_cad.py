"""Faces, exactness and speed of CAD files, beside OpenCASCADE, on one thread: a table, a row a file.

python tools/bench_cad.py FOLDER [--rays 200000] [--theirs 2000] [--out cad.json]

Rays aim at random points of the model's box from a sphere around it. OpenCASCADE is asked for its nearest
hit (IntCurvesFace_ShapeIntersector) at the first of them; rounds of both take turns. Times are processor
seconds. "same": rays for which both find the same t within 1e-6 of the size.
With --edges rays are aimed at points of the curves that trim faces, every second one at a vertex. A line more
tells how many of them do not enter and leave closed parts in turn, before and after `CadModel.paired`, and
how many come in between faces: their first hit, if any, is from behind, and not within the gap of an edge.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt import Intersector, read_cad
from hybrid_rt.cad.model import CadModel
from hybrid_rt.cad.process import SUFFIXES
from hybrid_rt.cli.command import kept, one_or_more, run_tool, say
from hybrid_rt.core.records import Flag, FloatArray, Status
from meshing import TrimmedSurface

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


def at_edges(model: CadModel, n: int) -> dict[str, Any]:
    """Return what rays aimed at the edges of a model meet; there are about n."""
    rng = np.random.default_rng(3)
    faces = [s for s in model.surfaces if isinstance(s, TrimmedSurface)]
    places = []
    for face in faces:
        curves = [curve for loop in face.loops for curve in loop]
        m = -(-n // len(faces))
        s = np.where(rng.random(m) < 0.5, 0.0, rng.random(m))
        uv = np.concatenate(
            [
                curves[k].point([x])
                for k, x in zip(rng.integers(len(curves), size=m), s, strict=True)
            ]
        )
        places.append(face.point(*np.where(face.closes, uv % 1.0, np.clip(uv, 0.0, 1.0)).T))
    aims = np.concatenate(places)
    ways = rng.normal(size=aims.shape)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    origins = aims - 2.0 * np.linalg.norm(np.ptp(model.bounds, axis=0)) * ways
    tracer = Intersector(model.surfaces, coarse="none", threads=1)
    crossings = tracer.intersect_all(origins, ways)
    paired, is_paired = model.paired(crossings)
    left_out = np.bincount(crossings.ray, minlength=len(aims)) - paired.count
    first = crossings.hits[crossings.offsets[:-1][crossings.count > 0]]
    is_edge = first.flags & Flag.EDGE > 0
    closed = np.array([part.is_closed for part in model.parts])[model.part_at(first)]
    leaks = closed & ~first.front_face & ~is_edge & (first.status != Status.TANGENT)
    return {
        "edge_rays": len(aims), "odd_before": float(((left_out > 0) | ~is_paired).mean()),
        "odd_after": int((~is_paired).sum()), "edge_share": float(is_edge.mean()),
        "leaks": int(leaks.sum()) + int((crossings.count == 0).sum()),
    }  # fmt: skip


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


def measured(file: Path, n: int, n_theirs: int, n_edges: int) -> dict[str, Any]:
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
    return row | (at_edges(model, n_edges) if n_edges else {})


def line(row: dict[str, Any]) -> str:
    """Return a row of the table."""
    rate, theirs = row["rays_per_second"], row.get("theirs_per_second", np.nan)
    edges = ""
    if "edge_rays" in row:
        edges = (
            f"\n    {row['edge_rays']:,} rays at edges: {100 * row['odd_before']:.1f} % not in turn before pairing, "
            f"{row['odd_after']} rays after; {100 * row['edge_share']:.0f} % of first hits EDGE, {row['leaks']} leaks"
        )
    return (
        f"{row['file'][:34]:34} {row['faces']:6d} {100 * row['exact']:6.1f}% {row['refused']:7d} "
        f"{row['build_seconds']:8.1f} {rate / 1e3:9.0f} {theirs / 1e3:7.2f} {rate / theirs:6.0f} "
        f"{100 * row.get('same', np.nan):7.2f}% {row['largest_gap']:11.2g}{edges}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rays", type=one_or_more, default=200_000)
    parser.add_argument("--theirs", type=one_or_more, default=2000, help="rays for OpenCASCADE")
    parser.add_argument("--edges", type=one_or_more, default=0, help="rays aimed at edges")
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
                rows.append(measured(file, options.rays, options.theirs, options.edges))
                say(line(rows[-1]))
            except (ValueError, TimeoutError) as error:
                say(f"{file.name}: {error}")


if __name__ == "__main__":
    sys.exit(run_tool(main))
