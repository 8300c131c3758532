"""A box [-1, 1]^3 after the one at Cornell, open to the front, with a mirror and a glass sphere.

Run it: python scenes/cornell_box.py --passes 64
"""

import sys

from hybrid_rt import (
    Camera,
    Dielectric,
    Lambertian,
    Mirror,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
)

WHITE, RED, GREEN = (0.73, 0.73, 0.73), (0.65, 0.05, 0.05), (0.12, 0.45, 0.15)
# (middle, half edge u, half edge v): the normals u x v point into the box.
WALLS = {
    "floor": ((0, -1, 0), (1, 0, 0), (0, 0, -1), WHITE),
    "ceiling": ((0, 1, 0), (1, 0, 0), (0, 0, 1), WHITE),
    "back": ((0, 0, -1), (1, 0, 0), (0, 1, 0), WHITE),
    "left": ((-1, 0, 0), (0, 1, 0), (0, 0, 1), RED),
    "right": ((1, 0, 0), (0, 0, 1), (0, 1, 0), GREEN),
}


def wall(name: str) -> Object:
    """Return one side of the box."""
    middle, u, v, color = WALLS[name]
    corner = [m - a - b for m, a, b in zip(middle, u, v, strict=True)]
    surface = Rectangle(corner, [2 * a for a in u], [2 * b for b in v])
    return Object(surface, Lambertian(color), name)


def scene() -> Scene:
    """Describe the picture."""
    return Scene(
        camera=Camera(
            look_from=(0.0, 0.0, 3.9),
            look_at=(0.0, 0.0, 0.0),
            up=(0.0, 1.0, 0.0),
            vertical_fov=39.0,
            width=256,
            height=256,
        ),
        objects=[
            *(wall(name) for name in WALLS),
            Object(Sphere((-0.45, -0.65, -0.35), 0.35), Mirror(), "mirror"),
            Object(Sphere((0.45, -0.65, 0.3), 0.35), Dielectric(1.5), "glass"),
        ],
        lights=[RectangleLight((-0.25, 0.999, -0.25), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), 17.0)],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
