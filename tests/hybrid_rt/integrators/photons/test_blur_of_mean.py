"""The blur of the image mean: what discs lose that reach over the border of what is lit."""

import numpy as np
import pytest

from hybrid_rt import (
    Camera,
    Lambertian,
    Mirror,
    Object,
    PhotonMapOptions,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    render,
)
from hybrid_rt.integrators.photons.figures import BlurSums

ALBEDO, RADIANCE = 0.5, 2.0


def floor_of_a_pipe(width=0.8, depth=0.6, height=0.5):
    """Return a floor below walls of perfect mirrors, and a lamp that fills the other end.

    The mirrors repeat the lamp without end, so the floor has the irradiance pi x radiance everywhere. What
    it sends back ends at the lamp.
    """
    x, y = 0.5 * width, 0.5 * depth
    walls = [
        Rectangle((-x, -y, 0), (0, depth, 0), (0, 0, height)),
        Rectangle((x, -y, 0), (0, depth, 0), (0, 0, height)),
        Rectangle((-x, -y, 0), (width, 0, 0), (0, 0, height)),
        Rectangle((-x, y, 0), (width, 0, 0), (0, 0, height)),
    ]
    # The floor goes on beyond the walls: photons there would be seen, and there are none.
    floor = Object(Rectangle((-2, -2, -1e-9), (4, 0, 0), (0, 4, 0)), Lambertian(ALBEDO))
    lamp = RectangleLight((-x, -y, height), (0, depth, 0), (width, 0, 0), radiance=RADIANCE)
    far = 0.8 * height
    camera = Camera(
        (0, 0, far), (0, 0, 0), (0, 1, 0), 2 * np.degrees(np.arctan(y / far)), width=32, height=24
    )
    return Scene(camera, [floor, *(Object(wall, Mirror(1.0)) for wall in walls)], [lamp])


@pytest.mark.nightly
def test_a_wall_at_the_border_is_in_the_interval_of_the_mean():
    truth = ALBEDO * RADIANCE
    report = render(
        floor_of_a_pipe(), "ppm", passes=64, seed=1, max_depth=70, options=PPMOptions(5000)
    ).report
    noise, photons = report["noise"], report["photons"]
    lost = noise["image_mean"] - truth
    noise_alone = noise["interval_factor"] * noise["standard_error_of_image_mean"]
    # More than noise, or there would be nothing to test.
    assert lost < -2.0 * noise_alone
    assert abs(lost) < noise["half_interval_95_of_image_mean"]
    estimate, error = (
        photons["blur_of_image_mean"],
        photons["blur_of_image_mean_standard_error"],
    )
    # Three of its own standard errors, and what is of the second order in the radius: corners.
    assert abs(estimate - lost) < 3.0 * error + 0.2 * abs(lost)
    assert abs(estimate) > 2.0 * error


def test_discs_wider_than_the_floor_lose_nothing():
    """Those of a photon map are divided by what the floor covers of them; it lost 3 % before."""
    options = PhotonMapOptions(5000)
    scene = floor_of_a_pipe()
    noise = render(scene, "photon_map", 16, seed=1, max_depth=70, options=options).report["noise"]
    gap = abs(noise["image_mean"] - ALBEDO * RADIANCE)
    assert gap < noise["half_interval_95_of_image_mean"] < 0.02


def test_runs_count_as_their_passes_do():
    rng = np.random.default_rng(1)
    changes = rng.normal(size=(12, 20, 3))
    image = np.zeros((4, 5, 3), np.float32)
    singly, by_runs = BlurSums(4, 5), BlurSums(4, 5)
    for change in changes:
        singly.add(change)
    for run in changes.reshape(3, 4, 20, 3):
        total = np.zeros((2, 20, 3))
        for change in run:
            total += change, change * change
        by_runs.add_run(total)
    assert singly.estimate(image) == by_runs.estimate(image)
    gone_on = BlurSums(4, 5)
    gone_on.restore(singly.state())
    assert gone_on.estimate(image) == singly.estimate(image)


def test_its_error_is_that_of_independent_passes():
    """The mean of 64 passes of unit noise is known to 1 / 8; 16 runs tell this to 18 %, one sigma."""
    rng = np.random.default_rng(2)
    sums = BlurSums(1, 1)
    assert sums.estimate(np.zeros((1, 1, 3), np.float32)).of_mean is None
    for value in rng.normal(size=64):
        sums.add(np.full((1, 3), value))
    found = sums.estimate(np.zeros((1, 1, 3), np.float32))
    factor = 1.0 / (1.0 - np.sqrt(0.5))
    assert found.of_mean_error == pytest.approx(factor / 8.0, rel=0.5)
    assert abs(found.of_mean) < 3.0 * factor / 8.0
