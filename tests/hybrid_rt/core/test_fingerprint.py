"""Fingerprints: equal contents, equal names; everything that matters changes them."""

import math
import subprocess
import sys
from functools import cached_property

import numpy as np
import pytest

from hybrid_rt import Camera, Dielectric, Lambertian, Object, RectangleLight, Sphere
from hybrid_rt.core.fingerprint import fingerprint
from hybrid_rt.textures import ImageTexture
from meshing import BezierPatches

NET = np.random.default_rng(3).normal(size=(4, 4, 3))


def things():
    pixels = np.random.default_rng(4).random((3, 5, 3))
    return {
        "camera": Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), width=64, height=48),
        "ball": Object(Sphere((0, 0, 0), 1.0), Dielectric(1.5), "ball"),
        "lamp": RectangleLight((0, 3, 0), (1, 0, 0), (0, 0, 1), (5, 5, 5)),
        "sheet": Object(BezierPatches([NET]), Lambertian(ImageTexture(pixels))),
    }


def test_the_same_scene_has_the_same_fingerprints_in_another_process():
    code = (
        "import sys; sys.path[:0] = {path!r}\n"
        "from test_fingerprint import fingerprint, things\n"
        "print({{name: fingerprint(one) for name, one in things().items()}})"
    ).format(path=[__file__.rsplit("/", 1)[0], *sys.path])
    text = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert text.strip() == str({name: fingerprint(one) for name, one in things().items()})


@pytest.mark.parametrize(
    "other",
    [
        Object(Sphere((0, 0, 0), np.nextafter(1.0, 2.0)), Dielectric(1.5), "ball"),
        Object(Sphere((0, 0, -1e-300), 1.0), Dielectric(1.5), "ball"),
        Object(Sphere((0, 0, 0), 1.0), Dielectric(1.5000000000000002), "ball"),
        Object(Sphere((0, 0, 0), 1.0), Lambertian((0.5, 0.5, 0.5)), "ball"),
    ],
)
def test_a_last_bit_changes_it(other):
    assert fingerprint(other) != fingerprint(things()["ball"])


def test_a_bit_of_an_array_changes_it():
    moved = NET.copy()
    moved[3, 3, 2] = np.nextafter(moved[3, 3, 2], 9.0)
    assert fingerprint(BezierPatches([NET])) == fingerprint(BezierPatches([NET.copy()]))
    assert fingerprint(BezierPatches([NET])) != fingerprint(BezierPatches([moved]))
    assert fingerprint(np.zeros(4)) != fingerprint(np.zeros((2, 2)))
    assert fingerprint(np.zeros(4)) != fingerprint(np.zeros(8, dtype=np.float32))


def test_structure_counts_and_caches_do_not():
    class Thing:
        def __init__(self, value):
            self.value = value

        @cached_property
        def double(self):
            return 2 * self.value

    asked = Thing(3)
    assert asked.double == 6
    assert fingerprint(asked) == fingerprint(Thing(3)) != fingerprint(Thing(4))
    assert fingerprint([[1], 2]) != fingerprint([1, [2]])
    assert fingerprint({"a": 1}) != fingerprint({"a": "1"})
    assert fingerprint({1, 2, 3}) == fingerprint({3, 2, 1})
    assert fingerprint(0.0) != fingerprint(-0.0)


def test_what_holds_itself_ends():
    ring = [1]
    ring.append(ring)
    assert fingerprint(ring) == fingerprint(ring)


def test_functions_count_by_what_they_do():
    def scaled(k):
        return lambda x: k * x

    assert fingerprint(scaled(2)) == fingerprint(scaled(2)) != fingerprint(scaled(3))
    # The code is the same, but for the names that it looks up.
    assert len({fingerprint(f) for f in (lambda x: -math.sin(x), lambda x: -math.cos(x))}) == 2
    assert len({fingerprint(f) for f in (np.sin, np.cos, math.sin)}) == 3

    # Comprehensions and functions within it are code of their own.
    def doubled(numbers):
        return [2 * x for x in numbers]

    def tripled(numbers):
        return [3 * x for x in numbers]

    tripled.__qualname__ = doubled.__qualname__
    assert fingerprint(doubled) != fingerprint(tripled)

    def shifted(by):
        def shift(x, *, by=by):
            return x + by

        return shift

    assert fingerprint(shifted(1)) == fingerprint(shifted(1)) != fingerprint(shifted(2))


def test_what_cannot_be_kept_is_refused(tmp_path):
    with (tmp_path / "file").open("w") as file, pytest.raises(TypeError):
        fingerprint(file)
