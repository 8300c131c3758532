"""A picture study that several tests read."""

import numpy as np
import pytest

from hybrid_rt.analysis.methods import Method
from hybrid_rt.analysis.picture_comparison import Picture
from hybrid_rt.analysis.work_precision import study_picture
from hybrid_rt.materials import Emissive, Lambertian
from hybrid_rt.primitives import Box
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera


@pytest.fixture(scope="session")
def room():
    walls = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), Emissive(1.0, Lambertian(0.5)))
    scene = Scene(Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, 16, 12), [walls])
    truth = Picture("truth", np.full((12, 16, 3), 2.0, np.float32), None, None)
    methods = [Method("path", "path"), Method("again", "path")]
    return study_picture(scene, (4, 16, 64), runs=2, reference=truth, methods=methods, threads=1)
