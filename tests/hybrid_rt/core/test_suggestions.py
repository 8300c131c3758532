"""Keywords that do not exist: the message says what is meant."""

import inspect
import warnings

import pytest

from hybrid_rt import (
    Camera,
    Dielectric,
    PPMOptions,
    RoughConductor,
    SphereLight,
    render,
)


@pytest.mark.parametrize(
    ("call", "keywords", "message"),
    [
        (render, {"spp": 16}, "render has no argument 'spp': pass passes"),
        (PPMOptions, {"photons": 1000}, "PPMOptions has no argument 'photons': pass photons_per_pass"),
        (SphereLight, {"power": 3.0}, r"radiance = power / \(4 pi\^2 radius\^2\)"),
        (RoughConductor.of, {"metal": "gold", "alpha": 0.09}, r"roughness = sqrt\(alpha\)"),
        (Dielectric, {"absorbtion": 1.0}, "Dielectric has no argument 'absorbtion': did you mean 'absorption'\\?"),
        (Camera, {"zoom": 2.0}, "it takes look_from, look_at, up, vertical_fov"),
    ],
)  # fmt: skip
def test_what_is_meant_is_said(call, keywords, message):
    with pytest.raises(TypeError, match=message):
        call(**keywords)


def test_missing_arguments_are_named_as_ever():
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'radius'"):
        SphereLight((0.0, 0.0, 0.0), radiance=1.0)


def test_signatures_are_those_that_were_written():
    assert list(inspect.signature(SphereLight).parameters) == ["center", "radius", "radiance"]
    assert "self" not in inspect.signature(Camera).parameters


def test_warnings_point_to_the_caller():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        PPMOptions(alpha=1.0)
    assert [one.filename for one in caught] == [__file__]
