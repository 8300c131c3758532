"""Rays that begin on a plane and run nearly within it: rounding decides whether they meet it.

The plane is z = 0, rays begin at height h and sink by s: the root is at h / s, and a step of the band,
64 eps times the size, moves it by the band over s.
"""

import numpy as np
import pytest

from hybrid_rt import Box, Intersector, Plane, Rectangle, Status

SIZE = 2.0
BAND = 64 * 2.0**-52 * SIZE
TURN = np.array([[1, 0, 0, 0], [0, 0.6, -0.8, 0], [0, 0.8, 0.6, 0], [0, 0, 0, 1.0]])
FLAT = {
    "rectangle": Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)),
    "plane": Plane((SIZE, 0, 0), (0, 0, 1)),
    "box": Box((-1, -1, -1), (1, 1, 0)),
}


@pytest.fixture(params=FLAT)
def tracer(request):
    return Intersector([FLAT[request.param]])


def status(tracer, height, slope):
    hits = tracer.intersect((0.0, 0.0, height), (1.0, 0.0, -slope))
    return Status(hits.status[0]), bool(hits.hit[0])


@pytest.mark.parametrize("slope", [1e-15, 1e-13, 1e-11])
@pytest.mark.parametrize("part", [0.01, 0.1])
def test_a_start_within_the_band_is_marked(tracer, slope, part):
    above, _ = status(tracer, part * BAND, slope)
    below, _ = status(tracer, -part * BAND, slope)
    assert above == below == Status.TANGENT


@pytest.mark.parametrize("height", [1e-10, -1e-10])
def test_a_start_clear_of_the_plane_is_not(tracer, height):
    """A tenth of the way to the rim; the band moves that by 3e-4 of it."""
    found, is_hit = status(tracer, height, 10 * height)
    if height > 0.0 or not isinstance(tracer.surfaces[0], Box):
        assert found == Status.HIT
        assert is_hit
    assert found != Status.TANGENT


def test_the_face_that_a_ray_leaves_is_no_matter_of_rounding(tracer):
    first = tracer.intersect((0.25, 0.1, 1.0), (0, 0, -1.0))
    # At 1e-15 a ray that leaves the box passes its edge within the band.
    slopes = [-1e-12] if isinstance(tracer.surfaces[0], Box) else [1e-15, -1e-15, 1e-12, -1e-12]
    for slope in slopes:
        hits = tracer.intersect(first.position, (1.0, 0.0, -slope), source=first)
        assert hits.status[0] == Status.MISS


@pytest.mark.parametrize("side", [-1, 1])
def test_a_ray_along_two_faces_at_once(side):
    """The start is within the band of one face only; of the other the ray has long been inside."""
    origin, direction = (0.0, 0.5, side * 0.01 * BAND), (1.0, 1e-13, -1e-13)
    for box, turn in ((FLAT["box"], np.eye(3)), (FLAT["box"].transformed(TURN), TURN[:3, :3])):
        hits = Intersector([box]).intersect(turn @ origin, turn @ direction)
        assert hits.status[0] == Status.TANGENT


def test_a_turned_box_says_the_same():
    box = FLAT["box"].transformed(TURN)
    turn = TURN[:3, :3]
    for part, slope in ((0.1, 1e-13), (-0.1, 1e-13), (0.01, 1e-11)):
        origin = turn @ (0.0, 0.0, part * BAND)
        hits = Intersector([box]).intersect(origin, turn @ (1.0, 0.0, -slope))
        assert hits.status[0] == Status.TANGENT


def test_rays_parallel_to_a_slanted_plane_never_meet_it():
    """The rounded unit normal of most of these planes is not across the ray: it would be met at 1e16."""
    rng = np.random.default_rng(1)
    normals, others, origins = rng.integers(-9, 10, (3, 200, 3)).astype(float)
    for normal, other, origin in zip(normals, others, origins, strict=True):
        along = np.cross(normal, other)
        if not along.any() or origin @ normal == 0.0:
            continue
        for length in (1.0, 2.0**900, 2.0**-900):
            plane = Plane((0, 0, 0), length * normal)
            hits = Intersector([plane]).intersect(origin, [along, -along])
            assert (hits.status == Status.MISS).all()
        np.testing.assert_array_equal(plane.exact_normal @ along, 0.0)
        mirrored = plane.flipped().transformed(np.diag([2.0, 2.0, 2.0, 1.0]))
        hits = Intersector([mirrored]).intersect(origin, [along, -along])
        assert (hits.status == Status.MISS).all()
