"""A scene script for commands: a ball under a sky."""

SCRIPT = """
from hybrid_rt import Camera, GradientSky, Lambertian, Object, Scene, Sphere


def scene():
    camera = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=64, height=48)
    return Scene(
        camera, [Object(Sphere((0, 0, 0), 1), Lambertian(0.5))], environment=GradientSky(0, 1)
    )
"""
