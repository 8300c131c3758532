"""Rays that leave a surface do not meet the point that they leave from, and nothing else is lost."""

import mpmath
import numpy as np
import pytest

from hybrid_rt import (
    Camera,
    Dielectric,
    GradientSky,
    Intersector,
    Object,
    Plane,
    Scene,
    Sphere,
    render,
)
from hybrid_rt.core.records import NamedPoints
from hybrid_rt.integrators.kernels.photon_emission import Launch, Targets, launch_from_lights
from hybrid_rt.lights import SphereLight
from hybrid_rt.lights.table import compile_lights
from hybrid_rt.shading.kernels.light_kinds import LightPoints
from hybrid_rt.textures.table import compile_textures

# Far from 0 compared with some of their points: they pass 0, or near it.
SPHERES = [
    ((0.0, 1.0, 0.0), 1.0),
    ((0.3, 0.2, 0.1), 0.37),
    ((0.0, -1000.0, 0.0), 1000.0),
    ((1e5, 0.0, 0.0), 99999.0),
]

AHEAD = np.array([0.0, 0.0, 3.0])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def directions_from(normal, rng):
    """Half of them evenly in all directions, half of them grazing, cos from 1e-1 to 1e-6."""
    n = len(normal)
    aside = unit(np.cross(normal, unit(rng.normal(size=(n, 3)))))
    cosine = 10.0 ** rng.uniform(-6, -1, (n, 1)) * rng.choice([-1.0, 1.0], (n, 1))
    return np.where(
        rng.random((n, 1)) < 0.5, unit(rng.normal(size=(n, 3))), aside + cosine * normal
    )


def on_the_near_side(center, radius, n, rng):
    """Rays onto a sphere from outside: half of its points lie within 1e-12 to 1 radius of 0."""
    center = np.asarray(center)
    toward_0 = -center / np.linalg.norm(center)
    spread = 10.0 ** rng.uniform(-12, 0, (n, 1)) * unit(rng.normal(size=(n, 3)))
    outward = np.where(rng.random((n, 1)) < 0.5, unit(toward_0 + spread), unit(spread))
    return center + 2.0 * radius * outward, -outward


def leave(hits, center, radius, tracer, rng):
    """One generation: rays from hits, and what they must meet. Returns those that meet something."""
    direction = directions_from(hits.normal, rng)
    met = tracer.intersect(hits.position, direction, source=hits)
    slope = np.einsum("ij,ij->i", hits.position - center, direction)
    slope /= radius * np.linalg.norm(direction, axis=1)
    inward = slope < 0.0
    assert not met.hit[~inward].any()
    assert met.hit[inward].all()
    # The other root is 2 r cos away. The point lies off the sphere by an ulp of its coordinates,
    # which moves the chord by that over cos; the cosine above has the rounding of a sum.
    size = np.abs(hits.position).max(axis=1)
    slack = 4 * 2.0**-52 * (size / np.abs(slope) + 4.0 * radius)
    length = np.linalg.norm(direction, axis=1)
    gap = np.abs(met.t * length + 2.0 * radius * slope)
    assert (gap <= slack + met.t_bound * length)[inward].all()
    return met[met.hit]


@pytest.mark.parametrize(("center", "radius"), SPHERES)
def test_spheres_that_pass_near_zero_are_not_met_again(center, radius):
    rng = np.random.default_rng(20)
    tracer = Intersector([Sphere(center, radius)])
    hits = tracer.intersect(*on_the_near_side(center, radius, 150_000, rng))
    assert hits.hit.all()
    for _ in range(3):
        hits = leave(hits, center, radius, tracer, rng)


@pytest.mark.parametrize(("center", "radius"), SPHERES)
def test_positions_lie_on_spheres_to_the_last_digits_of_their_coordinates(center, radius):
    rng = np.random.default_rng(21)
    sphere = Sphere(center, radius)
    hits = Intersector([sphere]).intersect(*on_the_near_side(center, radius, 200, rng))
    for points in (hits.position, sphere.point(hits.u, hits.v)):
        for p in points.tolist():
            with mpmath.workdps(60):
                f = [mpmath.mpf(a) - mpmath.mpf(b) for a, b in zip(p, center, strict=True)]
                off = mpmath.sqrt(sum(x * x for x in f)) - radius
            # Half an ulp of three coordinates; 2**-100 of the radius is that of the method.
            assert abs(off) <= 3**0.5 * 2.0**-53 * max(map(abs, p)) + 2.0**-95 * radius


@pytest.mark.parametrize("corner", [0.0, 1.0, 1e5])
@pytest.mark.parametrize("distance", [3.0, 1e3, 1e6])
def test_planes_met_from_afar_are_not_met_again(distance, corner):
    rng = np.random.default_rng(22)
    normal = unit(rng.normal(size=(1, 3)))[0]
    along = np.cross(normal, (0.0, 0.0, 1.0))
    tracer = Intersector([Plane(corner * along, normal)])
    target = 0.5 * rng.uniform(-1, 1, (20_000, 3))
    origin = distance * unit(rng.normal(size=(20_000, 3)))
    hits = tracer.intersect(origin, target - origin)
    hits = hits[hits.hit]
    direction = directions_from(hits.normal, rng)
    assert not tracer.intersect(hits.position, direction, source=hits).hit.any()


def test_light_leaves_a_sphere_that_passes_near_zero():
    """Photons begin on the lamp that they leave: they do not end there."""
    n, rng = 100_000, np.random.default_rng(23)
    lamp = SphereLight((0.0, 1.0, 0.0), 1.0, 1.0)
    lights = compile_lights([lamp.row], [-1], False)
    nothing = LightPoints(*(np.zeros((0, 3)) if k < 2 else np.zeros(0) for k in range(5)))
    launch = Launch(*(np.zeros((n, 3)) for _ in range(3)))
    # Half of all points near 0, that is near the south pole: (s, t) = (1/2, 3/4).
    place = rng.random((n, 2))
    place[::2] = (0.5, 0.75) + 10.0 ** rng.uniform(-9, -1, (n // 2, 1)) * rng.uniform(
        -1, 1, (n // 2, 2)
    )
    textures = compile_textures([])
    launch_from_lights(
        lights, textures, nothing, np.zeros(n, np.int64), Targets(np.zeros((0, 3)), np.zeros(0)),
        np.full(n, n), np.zeros(n, np.int64), np.zeros(n, np.int64),
        place, rng.random((n, 2)), rng.random(n), np.empty((0, 5)), launch,
    )  # fmt: skip
    tracer = Intersector([lamp.surface])
    source = NamedPoints(np.zeros(n, np.int32), launch.origin)
    assert not tracer.intersect(launch.origin, launch.direction, source=source).hit.any()


def test_a_lone_glass_ball_is_closed_wherever_it_stands():
    """In a white furnace it is not seen; what is lost beyond ``max_depth`` is lost everywhere."""
    images = []
    for center, radius in [((0.0, 0.0, 0.0), 1.0), *SPHERES]:
        middle = np.asarray(center)
        scene = Scene(
            camera=Camera(middle + radius * AHEAD, middle, (0, 1, 0), 40, 48, 48),
            objects=[Object(Sphere(center, radius), Dielectric(1.5))],
            environment=GradientSky(1, 1),
        )
        result = render(scene, integrator="whitted", passes=4, max_depth=32)
        assert not result.report["clear_bodies_not_closed"]
        images.append(result.image)
    # At the silhouette a coordinate's last digits decide how often light is reflected before it
    # is cut off; the loss by cutting off is below 4e-3 there.
    for image in images:
        assert np.abs(image - images[0]).max() < 1e-3
        assert image.max() <= 1.0 + 1e-6
