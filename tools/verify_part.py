"""Report on the closed parts of all CAD files of a folder, against OpenCASCADE and dense samples: a table.

``python tools/verify_part.py FOLDER [--seconds 60] [--samples 200000]``. A least thickness that a sample undercuts by
more than rounding, a volume or an area that OpenCASCADE's is off by more than 1e-5, and a chord interval that does
not hold the volume are false reports: they are marked, counted, and make the exit code 1.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from hybrid_rt import read_cad
from hybrid_rt.cad.process import SUFFIXES
from hybrid_rt.part.mass import mass_of
from hybrid_rt.part.pairs import Found
from hybrid_rt.part.report import FINE, surfaces_of_part
from hybrid_rt.part.walls import ALIGNED, Walls

# Of volumes and areas, relative.
ALLOWED = 1e-5


def main() -> int:
    """Print a row for each closed part."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0, help="for each search")
    parser.add_argument("--samples", type=int, default=200_000)
    options = parser.parse_args()
    files = sorted(f for f in options.folder.iterdir() if f.suffix.lower() in SUFFIXES)
    n_false = sum(_rows(file, options.seconds, options.samples) for file in files)
    print(f"{n_false} false reports")
    return int(n_false > 0)


def _rows(file: Path, seconds: float, samples: int) -> int:
    model, n_false = read_cad(file, refuse="skip"), 0
    for k, part in enumerate(model.parts):
        if not part.is_closed:
            continue
        began = time.perf_counter()
        walls = Walls(surfaces_of_part(model, k)[0], np.deg2rad(20.0))
        _ = walls.joints, walls.samples
        built = time.perf_counter() - began
        ray, ray_cpu = _timed(lambda w=walls: w.least_ray(FINE * w.size, seconds))
        ball, ball_cpu = _timed(lambda w=walls: w.least_ball(FINE * w.size, seconds))
        false = [_undercut(walls, ray, ball, samples)]
        mass = mass_of(walls.solid, walls.tracer, model.bounds)
        false.append(abs(mass.chord_volume - mass.volume) > mass.chord_error)
        off = [
            abs(own / judged - 1.0)
            for own, judged in zip((mass.volume, mass.area), _judged(file, model), strict=True)
        ]
        if model.report["closed_parts"] == 1:
            false.append(max(off) > ALLOWED)
        n_false += sum(false)
        print(
            f"{file.stem:28} {part.faces.stop - part.faces.start:4} faces, size {walls.size:9.4f}, built {built:5.1f} s | "
            f"ray {_words(ray)} {ray_cpu:5.1f} s | ball {_words(ball)} {ball_cpu:5.1f} s | "
            f"volume off {off[0]:.1e}, area {off[1]:.1e}, not paired {mass.unpaired}{'  FALSE' if any(false) else ''}",
            flush=True,
        )
    return n_false


def _timed(search):
    began = time.process_time()
    found = search()
    return found, time.process_time() - began


def _words(found: Found) -> str:
    return f"{found.value:11.7f} >= {found.bound:11.7f} {'proven' if found.is_proven else 'open  '}"


def _undercut(walls: Walls, ray: Found, ball: Found, samples: int) -> bool:
    """Tell whether random points of the faces, where walls are antiparallel, are thinner than is proven."""
    rng = np.random.default_rng(11)
    areas = np.array([surface.area_sampler().area for surface in walls.solid.surfaces])
    for face, n in enumerate(rng.multinomial(samples, areas / areas.sum()).tolist()):
        surface = walls.solid.surfaces[face]
        uv = rng.random((n, 2))
        uv = uv[surface.contains(*uv.T)[0]]
        if not len(uv):
            continue
        points, normals = walls.solid.at(face, *uv.T)
        exits = walls.exits(points, normals)
        good = walls.opposite(normals, exits, ALIGNED)
        least = exits.t[good].min(initial=np.inf)
        if least < ray.bound * (1.0 - 1e-9):
            return True
        some = slice(0, 200)
        balls = walls.balls_at(points[some], normals[some], np.full(len(points[some]), face))[0]
        if balls.min(initial=np.inf) < ball.bound * (1.0 - 1e-9):
            return True
    return False


def _judged(file: Path, model) -> tuple[float, float]:
    """Return OpenCASCADE's volume and area of all solids."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_SOLID
    from OCP.TopExp import TopExp_Explorer

    reader = STEPControl_Reader()
    reader.ReadFile(str(file))
    reader.TransferRoots()
    unit = {"mm": 1.0, "inch": 25.4, "m": 1000.0, "cm": 10.0}[model.report["unit"]]
    volume = area = 0.0
    solids = TopExp_Explorer(reader.OneShape(), TopAbs_SOLID)
    while solids.More():
        for of, power in ((BRepGProp.VolumeProperties_s, 3), (BRepGProp.SurfaceProperties_s, 2)):
            judge = GProp_GProps()
            of(solids.Current(), judge, 1e-7)
            if power == 3:
                volume += judge.Mass() / unit**3
            else:
                area += judge.Mass() / unit**2
        solids.Next()
    return volume, area


if __name__ == "__main__":
    raise SystemExit(main())
