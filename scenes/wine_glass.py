"""A glass of red wine on a white cloth; the light that passes it lies beside it.

The wine reaches a little into its glass, which has the higher priority: no gap of air between them.

Run it: python scenes/wine_glass.py --passes 32
"""

import sys

from hybrid_rt import Camera, Dielectric, Lambertian, Object, Rectangle, Scene, SphereLight
from meshing import SurfaceOfRevolution

# Photons find caustics seen through glass and in mirrors, which paths meet by luck only.
INTEGRATOR = "ppm"
# (height, radius): underside, rim of the foot, foot, stem, bowl, lip, and back down the inside.
GLASS = (
    ((0.0, 0.0), (0.0, 1.0)),
    ((0.0, 1.0), (0.02, 1.04), (0.06, 1.04), (0.07, 1.0)),
    ((0.07, 1.0), (0.12, 0.5), (0.15, 0.12), (0.5, 0.09)),
    ((0.5, 0.09), (0.9, 0.07), (1.4, 0.07), (1.75, 0.1)),
    ((1.75, 0.1), (1.95, 0.25), (2.1, 1.05), (2.9, 1.0)),
    ((2.9, 1.0), (3.3, 0.97), (3.7, 0.85), (3.9, 0.75)),
    ((3.9, 0.75), (3.93, 0.745), (3.93, 0.705), (3.9, 0.71)),
    ((3.9, 0.71), (3.7, 0.81), (3.3, 0.93), (2.9, 0.96)),
    ((2.9, 0.96), (2.12, 1.0), (1.95, 0.2), (1.86, 0.0)),
)
# Between the two sides of the bowl, and level on top.
WINE = (
    ((1.81, 0.0), (1.95, 0.225), (2.11, 1.025), (2.9, 0.98)),
    ((2.9, 0.98), (2.9, 0.0)),
)


def scene() -> Scene:
    """Describe the picture."""
    table = Rectangle((-8.0, -8.0, 0.0), (16.0, 0.0, 0.0), (0.0, 16.0, 0.0))
    wall = Rectangle((-8.0, 5.0, 0.0), (16.0, 0.0, 0.0), (0.0, 0.0, 8.0))
    place, up = (0.0, 0.0, 0.001), (0.0, 0.0, 1.0)
    return Scene(
        camera=Camera(
            look_from=(0.6, -9.0, 5.0),
            look_at=(0.75, 0.0, 1.55),
            up=up,
            vertical_fov=32.0,
            width=600,
            height=600,
        ),
        objects=[
            Object(SurfaceOfRevolution(GLASS, place, up), Dielectric(1.5), "glass"),
            Object(
                SurfaceOfRevolution(WINE, place, up),
                Dielectric(1.34, (0.35, 2.6, 2.2), priority=-1.0),
                "wine",
            ),
            Object(table, Lambertian((0.75, 0.72, 0.68)), "cloth"),
            Object(wall, Lambertian((0.3, 0.36, 0.42)), "wall"),
        ],
        lights=[
            SphereLight((-4.6, 1.6, 6.2), 0.22, 420.0),
            SphereLight((5.0, -7.0, 6.0), 1.0, 3.0),
        ],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
