import pytest

from hybrid_rt import Camera, Lambertian, Object, PointLight, Rectangle, Scene, Sphere, render
from hybrid_rt.rendering.summary import in_words, per_cent, warnings_in_words


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0 %"),
        (0.00123, "0.12 %"),
        (0.345, "34 %"),
        (0.994, "99 %"),
        (0.996, "100 %"),
        (1.9, "190 %"),
        (123.4, "12,000 %"),
        (1e9, "1e+11 %"),
        (float("nan"), "nan %"),
    ],
)
def test_two_digits_of_a_share(share, text):
    assert per_cent(share) == text


@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_a_black_picture_is_a_warning(integrator):
    floor = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.5))
    shade = Object(Sphere((0, 0, 1), 0.5), Lambertian(0.5))
    camera = Camera((0, -6, 2), (0, 0, 0), (0, 0, 1), width=8, height=6)
    inside, above = PointLight((0, 0, 1), 50), PointLight((0, 0, 3), 50)
    dark = render(Scene(camera, [floor, shade], [inside]), integrator, passes=2, threads=1).report
    assert "WARNING   the picture is black: no light arrives" in in_words(dark)
    lit = render(Scene(camera, [floor, shade], [inside, above]), integrator, passes=2, threads=1)
    assert not warnings_in_words(lit.report)
