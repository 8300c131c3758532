"""Spheres only: mirror, clear glass, absorbing glass and a lens that blurs what is not in focus.

No surface is curved in a way that needs triangles, so neither tessellation nor Embree is used:
see --explain. Run it: python scenes/glass_and_mirror.py --passes 32
"""

import sys

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Dielectric,
    GradientSky,
    Lambertian,
    Mirror,
    Object,
    Phong,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
)


def scene() -> Scene:
    """Describe the picture."""
    floor = Rectangle((-30.0, -30.0, 0.0), (60.0, 0.0, 0.0), (0.0, 60.0, 0.0))
    checks = CheckerTexture((0.8, 0.78, 0.74), (0.3, 0.12, 0.1), 60, "uv")
    return Scene(
        camera=Camera(
            look_from=(0.0, -9.0, 3.2),
            look_at=(0.0, 0.0, 0.9),
            up=(0.0, 0.0, 1.0),
            vertical_fov=34.0,
            width=800,
            height=500,
            aperture=0.12,
            focus_distance=8.4,
        ),
        objects=[
            Object(Sphere((-2.3, 0.6, 1.2), 1.2), Mirror((0.95, 0.93, 0.88)), "mirror"),
            Object(Sphere((0.1, -1.0, 0.9), 0.9), Dielectric(1.5), "clear glass"),
            Object(Sphere((2.3, 0.4, 1.1), 1.1), Dielectric(1.5, (0.1, 0.6, 0.9)), "amber"),
            Object(Sphere((0.2, 3.2, 1.0), 1.0), Phong((0.1, 0.3, 0.5), 0.3, 80.0), "blue ball"),
            Object(Sphere((-1.2, -2.4, 0.4), 0.4), Phong((0.6, 0.5, 0.1), 0.3, 80.0), "marble"),
            Object(floor, Lambertian(checks), "floor"),
        ],
        lights=[RectangleLight((-4.0, -4.0, 7.0), (0.0, 2.5, 0.0), (2.5, 0.0, -0.8), 22.0)],
        environment=GradientSky((0.4, 0.38, 0.35), (0.3, 0.5, 0.85), up=(0.0, 0.0, 1.0)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
