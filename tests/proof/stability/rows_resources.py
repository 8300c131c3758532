"""Rows E01 to E11: the coarse stage, processes and threads, memory, layouts of arrays, stores."""

from __future__ import annotations

import json
import logging
import multiprocessing
import signal
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import at_box, silhouettes
from hybrid_rt.core.records import FloatArray
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits
from hybrid_rt.primitives import Sphere
from hybrid_rt.rendering.store import IDENTITY, SUMS, PassStore, StoreError
from meshing import tessellate
from proof.cases.campaign import torus
from proof.cases.rays import chords, edges
from proof.stability.measure import differences
from proof.stability.row import Effort, Outcome, refusal, row

# Seconds for a child process, its compilations included.
LIMIT = 120


class _Liar:
    """A coarse stage that misses all, or names any triangle at any distance."""

    def __init__(self, honest: Any, n_triangles: int, seed: int, misses: bool) -> None:
        self._honest, self._n, self._misses = honest, n_triangles, misses
        self._rng = np.random.default_rng(seed)
        self.asked = 0

    def __getattr__(self, name: str) -> Any:
        """Be the honest stage in all else."""
        return getattr(self._honest, name)

    def first(self, origin: FloatArray, *_: Any) -> CoarseHits:
        """Return proposals that have nothing to do with the rays."""
        n, rng = len(origin), self._rng
        self.asked += n
        if self._misses:
            face = np.full(n, -1, np.int32)
        else:
            face = rng.integers(self._n, size=n).astype(np.int32)
        return CoarseHits(face, 100 * rng.random(n), rng.random(n) / 2, rng.random(n) / 2)


def _lied_to(effort: Effort, misses: bool) -> Outcome:
    total = Outcome()
    surfaces = [teapot(), torus()]
    for make, seed in ((chords, 6), (silhouettes, 7), (edges, 8)):
        rays = make(surfaces, effort.count(30_000, 400), seed + effort.seed)
        honest, liar = Intersector(surfaces), Intersector(surfaces, threads=1)
        coarse = liar._coarse
        assert coarse is not None
        scene: Any = _Liar(coarse.scene, coarse.n_triangles, effort.seed, misses)
        coarse.scene = scene
        a = honest.intersect(rays.origins, rays.directions)
        b = liar.intersect(rays.origins, rays.directions)
        names = differences(a, b)
        total += Outcome(rays=len(a), work=liar.counters["most_pieces"]).checked(
            not names, f"{', '.join(names)} depend on the coarse stage ({make.__name__})"
        )
        total = total.checked(scene.asked == len(a), "the coarse stage was not asked")
    return total


@row("E01", "coarse stage reports wrong hits", "identity")
def random_proposals(effort: Effort) -> Outcome:
    """Any triangle at any distance is proposed: no bit of the answer changes."""
    return _lied_to(effort, False)


@row("E02", "coarse stage misses", "identity")
def no_proposals(effort: Effort) -> Outcome:
    """Nothing is proposed: no bit of the answer changes."""
    return _lied_to(effort, True)


@row("E03", "arguments are used twice", "identity")
def twice(effort: Effort) -> Outcome:
    """Two calls give the same, and leave what they are given as it is."""
    tracer = Intersector([teapot()])
    rays = chords([teapot()], effort.count(50_000, 500), seed=effort.seed + 8)
    t_max = np.full(len(rays.origins), 20.0)
    kept = rays.origins.copy(), rays.directions.copy()
    a, b = (tracer.intersect(rays.origins, rays.directions, t_max=t_max) for _ in range(2))
    same = (t_max == 20.0).all() and all(
        np.array_equal(x, y) for x, y in zip(kept, (rays.origins, rays.directions), strict=True)
    )
    return (
        Outcome(rays=2 * len(a))
        .checked(not differences(a, b), "the second call differs from the first")
        .checked(bool(same), "an argument was written to")
    )


@row("E04", "no coarse mesh", "run with the packages made unimportable")
def without_packages(effort: Effort) -> Outcome:
    """Closed forms need neither Embree nor trimesh nor scipy."""
    del effort
    script = (
        "import sys\n"
        "for name in ('embreex', 'trimesh', 'scipy'): sys.modules[name] = None\n"
        "from hybrid_rt import Intersector, Sphere, Rectangle, Box, Plane\n"
        "tracer = Intersector([Sphere((0, 0, 0), 1), Plane((0, 0, -2), (0, 0, 1))])\n"
        "assert tracer.intersect((0, 0, 5), (0, 0, -1)).t[0] == 4.0\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], check=False, timeout=LIMIT, capture_output=True, text=True
    )
    return Outcome(rays=1).checked(done.returncode == 0, done.stderr[-500:])


def hits_in_a_child(queue: Any, n: int, seed: int) -> None:
    """Trace rays in another process."""
    rays = chords([teapot()], n, seed=seed)
    hits = Intersector([teapot()], threads=2).intersect(rays.origins, rays.directions)
    queue.put((hits.t, hits.u, hits.status))


@row("E05", "one worker, many; spawn and fork", "identity")
def workers(effort: Effort) -> Outcome:
    """Threads and processes change no bit."""
    n, total = effort.count(20_000, 500), Outcome()
    rays = chords([teapot()], n, seed=effort.seed + 13)
    one = Intersector([teapot()], threads=1).intersect(rays.origins, rays.directions)
    for threads in (2, 3, 8):
        many = Intersector([teapot()], threads=threads).intersect(rays.origins, rays.directions)
        names = differences(one, many)
        total += Outcome(rays=n).checked(not names, f"{threads} threads change {', '.join(names)}")
    for method in ("spawn", "fork"):
        context: Any = multiprocessing.get_context(method)
        queue = context.Queue()
        child = context.Process(target=hits_in_a_child, args=(queue, n, effort.seed + 13))
        child.start()
        t, u, status = queue.get(timeout=LIMIT)
        child.join(timeout=60)
        same = np.array_equal(t, one.t) and np.array_equal(u, one.u, equal_nan=True)
        same &= np.array_equal(status, one.status)
        total += Outcome(rays=n).checked(
            same and child.exitcode == 0, f"a process by {method} has other hits"
        )
    return total


@row("E06", "rays in random order", "identity")
def order(effort: Effort) -> Outcome:
    """No ray depends on its neighbours."""
    total, n = Outcome(), effort.count(100_000, 500)
    shuffled = effort.rng().permutation(n)
    for surfaces in ([torus(), Sphere((0, 0, 0), 0.3)], [teapot()]):
        tracer = Intersector(surfaces)
        rays = chords(surfaces, n, seed=effort.seed + 9)
        a = tracer.intersect(rays.origins, rays.directions)[shuffled]
        b = tracer.intersect(rays.origins[shuffled], rays.directions[shuffled])
        names = differences(a, b)
        total += Outcome(rays=n).checked(not names, f"order changes {', '.join(names)}")
    return total


@row("E07", "tolerance 0 or 1e-300", "refusal")
def no_tolerance(effort: Effort) -> Outcome:
    """Zero is refused; what cannot be reached is refused before the work."""
    del effort
    total = Outcome()
    for tolerance in (0.0, -1.0, np.nan):
        total += refusal(partial(tessellate, torus(), tolerance), "tolerance")
    return total + _too_fine(1e-300)


def _too_fine(tolerance: float) -> Outcome:
    try:
        tessellate(teapot(), tolerance)
    except (ValueError, MemoryError) as error:
        ok = "triangles" in str(error) or "memory" in str(error)
        return Outcome(rays=1).checked(ok, f"refused with {error!r}")
    return Outcome(rays=1, wrong=1, faults=(f"tolerance {tolerance:g} was accepted",))


@row("E08", "tessellation that memory does not hold", "refusal")
def too_many_triangles(effort: Effort) -> Outcome:
    """Triangles are counted before memory is used."""
    del effort
    return _too_fine(1e-14) + _too_fine(1e-12)


@row("E09", "arrays of any layout", "identity")
def layouts(effort: Effort) -> Outcome:
    """Read-only, Fortran-ordered and strided arrays are taken."""
    total, n = Outcome(), effort.count(20_000, 200)
    for surface in (torus(), teapot()):
        tracer = Intersector([surface])
        rays = at_box([surface], n, seed=effort.seed + 3)
        o, d = rays.origins, rays.directions
        expected = tracer.intersect(o, d)
        frozen = o.copy(), d.copy()
        for array in frozen:
            array.flags.writeable = False
        others = {
            "Fortran-ordered": (np.asfortranarray(o), np.asfortranarray(d)),
            "strided": (np.repeat(o, 2, axis=0)[::2], np.repeat(d, 2, axis=0)[::2]),
            "read-only": frozen,
            "reversed": (o[::-1].copy()[::-1], d[::-1].copy()[::-1]),
        }
        for name, arrays in others.items():
            names = differences(tracer.intersect(*arrays), expected)
            total += Outcome(rays=n).checked(not names, f"{name} arrays change {', '.join(names)}")
    return total


# Saves after every few passes, until it is killed.
_SAVES = """
import sys
from hybrid_rt.integrators import workers
from hybrid_rt.rendering import store
from hybrid_rt.rendering.renderer import render
from proof.stability.rows_light_stored import room
workers.TOGETHER, store.EVERY, store.SHARE = 1, 0.0, 1e9
render(room(), passes=10**6, store=sys.argv[1], resume=True, threads=1)
"""


@row("E10", "killed while its sums are written", "the render in one go")
def killed(effort: Effort) -> Outcome:
    """Kill -9 at random moments of a render that saves after each pass: the store goes on."""
    from hybrid_rt.rendering.renderer import render
    from proof.stability.rows_light_stored import room

    total, rng, before = Outcome(), effort.rng(), 0
    with tempfile.TemporaryDirectory() as name:
        sums = [Path(name) / file for file in SUMS]
        for _ in range(effort.count(12)):
            child = subprocess.Popen([sys.executable, "-c", _SAVES, name])
            times = [file.exists() and file.stat().st_mtime_ns for file in sums]
            until = time.monotonic() + LIMIT
            while [file.exists() and file.stat().st_mtime_ns for file in sums] == times:
                if child.poll() is not None or time.monotonic() > until:
                    break
                time.sleep(0.005)
            time.sleep(float(rng.uniform(0.0, 0.2)))
            child.kill()
            total = total.checked(child.wait() == -signal.SIGKILL, "the child ended by itself")
            part = render(room(), passes=before + 1, store=name, resume=True)
            done, kept = part.report.passes, part.report["store"]
            whole = render(room(), passes=done)
            total += Outcome(
                rays=whole.image.size, wrong=int((part.image != whole.image).sum())
            ).checked(done > before and bool(kept["lost"]), "passes were lost without a word")
            before = done
    return total


@row("E11", "a bit of a store flips", "the sums that were saved")
def flipped(effort: Effort) -> Outcome:
    """Any bit of any file: the sums that are taken up are those of one of the two saves."""
    from hybrid_rt.rendering.renderer import render
    from proof.stability.rows_light_stored import room

    total, scene = Outcome(), room().with_camera(room().camera.resized(8, 6))
    said = logging.getLogger("hybrid_rt.rendering.store")
    said.addFilter(_nothing)
    with tempfile.TemporaryDirectory() as name:
        for passes in (2, 3):
            render(scene, passes=passes, store=name, resume=True)
        files = [Path(name) / file for file in (IDENTITY, *SUMS)]
        identity = json.loads(files[0].read_text())
        del identity["format"]

        def taken_up() -> tuple[int, bytes]:
            store = PassStore(name, resume=True)
            try:
                saved = store.open(identity)
            except StoreError as error:
                return -1, str(error).encode()
            finally:
                store.close()
            assert saved is not None
            return saved.passes, saved.arrays["sums"].tobytes() + saved.arrays["run"].tobytes()

        newest, contents = taken_up(), [file.read_bytes() for file in files]
        files[2].unlink()
        expected = [newest, newest, taken_up()]
        files[2].write_bytes(contents[2])
        n_bits = 8 * sum(map(len, contents))
        step = max(n_bits // effort.count(n_bits, 100), 1)
        for file, whole, right in zip(files, contents, expected, strict=True):
            for i in range(effort.seed % step, 8 * len(whole), step):
                content = bytearray(whole)
                content[i // 8] ^= 1 << i % 8
                file.write_bytes(content)
                total += Outcome(rays=1, wrong=int(taken_up() != right))
            file.write_bytes(whole)
    said.removeFilter(_nothing)
    return total


def _nothing(_record: Any) -> bool:
    return False
