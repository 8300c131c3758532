"""Tables and scratch memory of the kernels that trace camera paths."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.records import HitRecord, NamedPoints, Status
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.ball_optics import MOST_WAYS
from hybrid_rt.integrators.kernels.branches import MOST_SPLITS
from hybrid_rt.integrators.kernels.connections import CANDIDATES
from hybrid_rt.integrators.kernels.followed_paths import Doubtful
from hybrid_rt.integrators.kernels.path_vertex import Tally, Vertex
from hybrid_rt.integrators.light_points import new_light_points
from hybrid_rt.intersection.kernels.search.rays import Record
from hybrid_rt.intersection.single_rays import SingleRayTracer
from hybrid_rt.shading.kernels.medium_stack import STACK
from hybrid_rt.shading.kernels.scatter import ABSORBED, LEFT, SCATTERED, SPECULAR

# From so many on they are traced together.
MOST_DOUBTFUL = 2**14


def columns_of(hits: HitRecord) -> Record:
    """Return the columns of hits as kernels take them."""
    return Record(*(getattr(hits, name) for name in Record._fields))


def new_vertex(
    hit: Record, n_slots: int, *, smooth: bool, contacts: bool, shining: bool, rough: bool
) -> Vertex:
    """Allocate a vertex.

    ``hit``, Record of one row; ``n_slots``: lobes of a material at most.
    ``smooth``: shading normals may differ from geometric ones. ``contacts``: faces may coincide.
    ``shining``: there are lights of kind `SURFACE`. ``rough``: there is rough glass.
    """
    return Vertex(
        hit=hit,
        geometric=np.empty((1 if smooth else 0, 3)),
        second=np.zeros(1 if contacts else 0, dtype=np.int32),
        light_point=new_light_points(1 if shining else 0),
        material=np.empty(1, dtype=np.int32),
        colors=np.empty((1, n_slots, 3)),
        ratio=np.empty(1 if rough else 0),
        beyond=np.empty((1, STACK) if rough else (0, 0), dtype=np.int32),
        xi=np.empty((1, 2)),
        choice=np.empty((1, 2)),
        onward=np.empty((1, 3)),
        target_pdf=np.empty(CANDIDATES),
        arrival_pdf=np.empty(1),
        found=np.empty(MOST_WAYS),
    )


def new_tally(n_lobes: int) -> Tally:
    """Allocate counters, all zero."""
    return Tally(
        fates=np.zeros(SPECULAR + 1, dtype=np.int64),
        lost=np.zeros(3),
        unclosed=np.zeros(n_lobes, dtype=np.int64),
        status=np.zeros(len(Status), dtype=np.int64),
        hits=np.zeros(3, dtype=np.int64),
        shadow=np.zeros(1, dtype=np.int64),
        bound=np.zeros(1),
    )


def count_vertices(tally: Tally, ledger: Ledger) -> None:
    """Add to a ledger what became of paths at their vertices."""
    fates = tally.fates
    ledger.rays["scattered"] += int(fates[SCATTERED])
    ledger.rays["mirrored or refracted"] += int(fates[SPECULAR])
    ledger.ended["absorbed or by roulette"] += int(fates[ABSORBED])
    ledger.ended["left the scene or met a lamp"] += int(fates[LEFT])
    if tally.lost[0]:
        ledger.ended["at max_depth"] += int(tally.lost[0])
    ledger.lost_weight += float(tally.lost[1])
    ledger.carried += float(tally.lost[2])
    for lobe in np.flatnonzero(tally.unclosed):
        ledger.unclosed[int(lobe)] += int(tally.unclosed[lobe])


def new_doubtful(max_depth: int) -> Doubtful:
    """Allocate rays whose status is told later: room for what some paths may add."""
    m = MOST_DOUBTFUL + 2 * (max_depth + 2) * (1 + MOST_SPLITS)
    n, source_id = np.zeros(1, dtype=np.int64), np.empty(m, dtype=np.int32)
    return Doubtful(n, np.empty((m, 3)), np.empty((m, 3)), source_id)


def count_single_rays(
    tally: Tally, doubtful: Doubtful, single: SingleRayTracer, context: RenderContext
) -> None:
    """Add to a ledger and an intersector the rays that were traced one by one.

    The doubtful ones are traced once more, which tells their status, and forgotten.
    """
    ledger, n = context.ledger, int(doubtful.n[0])
    if n:
        source = NamedPoints(doubtful.source_id[:n], doubtful.origin[:n])
        rays = doubtful.origin[:n], doubtful.direction[:n]
        ledger.count_hits(context.tracer.intersect(*rays, source=source))
        doubtful.n[0] = 0
    for status in Status:
        ledger.hits[status.name.lower()] += int(tally.status[status])
    ledger.rays["shadow"] += int(tally.shadow[0])
    ledger.camera_hits += int(tally.hits[1])
    ledger.camera_hits_without_bound += int(tally.hits[2])
    ledger.largest_t_bound = max(ledger.largest_t_bound, float(tally.bound[0]))
    context.tracer.count_single_rays(tally.status, tally.hits, tally.shadow, single.work)
    for counted in (tally.status, tally.hits, tally.shadow, tally.bound):
        counted[:] = 0
