"""A turned tube under a sky, and its scene: what studies measure in tests."""

from hybrid_rt.lights import GradientSky
from hybrid_rt.materials import Lambertian
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from meshing import SurfaceOfRevolution

TUBE = SurfaceOfRevolution([[-1.0, 1.0], [1.0, 1.0]], (0, 0, 0), (0, 0, 1))
VIEW = Camera((0, -6, 0.5), (0, 0, 0), (0, 0, 1), vertical_fov=30, width=24, height=16)
SKY = GradientSky(0.3, 1.0, up=(0, 0, 1))
SCENE = Scene(VIEW, [Object(TUBE, Lambertian(0.5))], environment=SKY)
