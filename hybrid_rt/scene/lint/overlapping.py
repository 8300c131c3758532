"""Clear bodies of the same priority that overlap in part: what fills the common space is undecided.

Among equals the body counts that a ray has entered last. So where neither lies within the other, the
space they share is filled by one of them for rays from one side, and by the other for rays from
the other side.
"""

import itertools
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.intersection import Intersector
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from meshing.surface import box_around

# Rays through the box that two bodies have in common: an overlap that all of them miss is not found.
RAYS = 64
# Of the size: shorter ways through both are those of bodies that touch.
SLACK = 1e-6
# Pairs whose boxes overlap; others are not looked at.
MOST_PAIRS = 50
# Where a point of a ray lies, as a sum.
ONE, OTHER = 1, 2


def overlapping_bodies(scene: CompiledScene, tracer: Intersector) -> list[list[str]]:
    """Return the pairs of clear bodies that overlap in part and have one priority, by name.

    Bodies of one medium are not named: it does not matter which of them fills the space.
    """
    surfaces_of: dict[int, list[int]] = defaultdict(list)
    for i in np.flatnonzero(scene.glass_of[scene.material_of[: len(scene.called)]] != NOTHING):
        surfaces_of[int(scene.material_of[i])].append(int(i))
    bodies = [
        rows for rows in surfaces_of.values() if all(scene.surfaces[i].is_bounded for i in rows)
    ]
    if len(bodies) < 2:
        return []
    boxes = np.array(
        [box_around(np.array([scene.surfaces[i].bounds for i in rows])) for rows in bodies]
    )
    glass = scene.glass_of[scene.material_of[[rows[0] for rows in bodies]]]
    # Index and absorption, then the priority.
    medium = scene.lobes.number[glass][:, [0, 2, 3, 4, 5]]
    found = [
        (one, other)
        for one, other in itertools.islice(_pairs_of_boxes(boxes, medium), MOST_PAIRS)
        if _overlap_in_part(tracer, bodies[one], bodies[other], boxes[[one, other]])
    ]
    return [[scene.called[bodies[k][0]] for k in pair] for pair in sorted(found)]


def _pairs_of_boxes(boxes: FloatArray, medium: FloatArray) -> Iterator[tuple[int, int]]:
    """Yield the pairs whose boxes overlap, of one priority and two media, by a sweep along x."""
    order = np.argsort(boxes[:, 0, 0], kind="stable")
    low, high, medium = boxes[order, 0], boxes[order, 1], medium[order]
    ends = np.searchsorted(low[:, 0], high[:, 0])
    for one, end in enumerate(ends.tolist()):
        others = slice(one + 1, end)
        overlap = (low[others, 1:] < high[one, 1:]) & (low[one, 1:] < high[others, 1:])
        is_equal = medium[others] == medium[one]
        is_pair = overlap.all(axis=1) & is_equal[:, -1] & ~is_equal.all(axis=1)
        for other in (one + 1 + np.flatnonzero(is_pair)).tolist():
            first, second = sorted((int(order[one]), int(order[other])))
            yield first, second


def _overlap_in_part(
    tracer: Intersector, one: list[int], other: list[int], boxes: FloatArray
) -> bool:
    """Tell whether a ray enters one body, then the other, and leaves the first one first."""
    low, high = boxes[:, 0].max(axis=0), boxes[:, 1].min(axis=0)
    around = box_around(boxes)
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((RAYS, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    size = float(np.linalg.norm(around[1] - around[0]))
    origins = rng.uniform(low, high, (RAYS, 3)) - size * directions
    crossed = tracer.intersect_all(origins, directions, t_max=2.0 * size)
    hits = crossed.hits
    of_one, of_other = np.isin(hits.object_id, one), np.isin(hits.object_id, other)
    is_of = of_one | of_other
    ray, t = crossed.ray[is_of], hits.t[is_of]
    step = np.where(hits.front_face[is_of], 1, -1)
    steps = np.stack([step * of_one[is_of], step * of_other[is_of]], axis=1)
    # Rays that do not leave what they have entered say nothing, and bodies that are open.
    is_odd = np.zeros(RAYS, dtype=np.bool_)
    for body in range(2):
        is_odd |= np.bincount(ray, weights=steps[:, body], minlength=RAYS) != 0
    is_good = ~is_odd[ray]
    return _is_crossed(np.cumsum(steps[is_good], axis=0), t[is_good], SLACK * size)


def _is_crossed(depth: FloatArray, t: FloatArray, slack: float) -> bool:
    """Tell whether a way through both bodies leads from one of them alone to the other alone."""
    within = (depth > 0) @ np.array([ONE, OTHER])
    before = np.append(0, within[:-1])
    is_change = within != before
    within, t = within[is_change], t[is_change]
    both: BoolArray = within[1:-1] == ONE + OTHER
    from_one_to_other = within[:-2] + within[2:] == ONE + OTHER
    is_alone = (within[:-2] != 0) & (within[2:] != 0)
    return bool((both & from_one_to_other & is_alone & (t[2:] - t[1:-1] > slack)).any())
