"""A glass ball and a matt one on a dark stage, in three spots with smooth edges.

The white spot passes the glass ball and is gathered on the floor and the back wall; the amber and
the blue one cross on the matt ball, which throws a shadow of the other colour for each.

Run it: python scenes/stage.py --passes 32
"""

import sys

from hybrid_rt import (
    Camera,
    Dielectric,
    Lambertian,
    Object,
    Rectangle,
    Scene,
    Sphere,
    SpotLight,
)

# What glass makes of the light of a point is found by photons only.
INTEGRATOR = "ppm"
GLASS_AT, MATT_AT = (-0.9, -0.3, 1.0), (0.95, 0.4, 0.6)


def spot(
    position: tuple[float, float, float],
    target: tuple[float, float, float],
    intensity: tuple[float, float, float],
    cone_angle: float,
    edge_angle: float,
) -> SpotLight:
    """Return a spot that is turned toward a target."""
    direction = tuple(b - a for a, b in zip(position, target, strict=True))
    return SpotLight(position, direction, intensity, cone_angle, edge_angle)


def scene() -> Scene:
    """Describe the picture."""
    floor = Rectangle((-5.0, -4.0, 0.0), (10.0, 0.0, 0.0), (0.0, 6.0, 0.0))
    wall = Rectangle((-5.0, 2.0, 0.0), (10.0, 0.0, 0.0), (0.0, 0.0, 5.0))
    return Scene(
        camera=Camera(
            look_from=(0.0, -6.0, 2.2),
            look_at=(0.05, 0.3, 0.85),
            up=(0.0, 0.0, 1.0),
            vertical_fov=30.0,
            width=480,
            height=320,
        ),
        objects=[
            Object(floor, Lambertian(0.6), "floor"),
            Object(wall, Lambertian((0.5, 0.48, 0.45)), "wall"),
            Object(Sphere(GLASS_AT, 0.6), Dielectric(1.5), "glass"),
            Object(Sphere(MATT_AT, 0.6), Lambertian(0.85), "matt"),
        ],
        lights=[
            spot((-1.9, -1.2, 4.4), GLASS_AT, (62.0, 60.0, 56.0), 13.0, 3.0),
            spot((-1.2, -3.6, 3.4), MATT_AT, (90.0, 38.0, 6.0), 15.0, 6.0),
            spot((3.8, -2.4, 2.6), MATT_AT, (10.0, 32.0, 95.0), 15.0, 6.0),
        ],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
