"""The oracle's events of a ray: roots, and near misses that rounding could turn into roots."""

from typing import Any, NamedTuple

from meshing.kernels.jit import inner

# COVERED is as certain as ROOT (all rays around meet the surface), but its t is theirs.
ROOT, COVERED, DOUBTFUL, UNDECIDED = 0, 1, 2, 3
# A root is doubtful where moving the ray by this many eps x scale could make or lose it.
BAND = 64.0 * 2.0**-52
# Rays moved by a little more, so that nothing on the rim of the band counts as certain.
SHIFT = 1.3
# Flatter than this rounding of the ray's own direction leaves nothing of a crossing's t.
LEAST_COSINE = 1e-16
# Cosines and sines of eight directions around the ray.
AROUND = (
    (1.0, 0.0),
    (0.7071067811865476, 0.7071067811865476),
    (0.0, 1.0),
    (-0.7071067811865476, 0.7071067811865476),
    (-1.0, 0.0),
    (-0.7071067811865476, -0.7071067811865476),
    (0.0, -1.0),
    (0.7071067811865476, -0.7071067811865476),
)


class Events(NamedTuple):
    """Growing list of events in arrays of fixed length; ``count[0]`` may exceed it."""

    count: Any  # (1,) int64
    ray: Any  # (capacity,) int64
    t: Any  # (capacity,) float64, in lengths of the ray's direction
    object_id: Any  # (capacity,) int32
    patch_id: Any  # (capacity,) int32
    u: Any  # (capacity,) float64
    v: Any  # (capacity,) float64
    cosine: Any  # (capacity,) float64, |n.d| / |d|
    band: Any  # (capacity,) float64, 64 eps x scale, a length
    kind: Any  # (capacity,) uint8: ROOT, COVERED, DOUBTFUL, UNDECIDED
    at_edge: Any  # (capacity,) uint8: 1 within the band of an edge of its patch


@inner
def note(events, ray, t, object_id, patch_id, u, v, cosine, band, kind, at_edge):
    """Append one event, if there is room."""
    k = events.count[0]
    events.count[0] = k + 1
    if k >= events.t.size:
        return
    events.ray[k] = ray
    events.t[k] = t
    events.object_id[k] = object_id
    events.patch_id[k] = patch_id
    events.u[k] = u
    events.v[k] = v
    events.cosine[k] = cosine
    events.band[k] = band
    events.kind[k] = kind
    events.at_edge[k] = at_edge
