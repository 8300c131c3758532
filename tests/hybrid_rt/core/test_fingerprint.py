"""Fingerprints: equal contents, equal names; everything that matters changes them."""

import math
import subprocess
import sys
import sysconfig
import threading
import types
from functools import cached_property

import numpy as np
import pytest

from hybrid_rt import Camera, Dielectric, Lambertian, Object, RectangleLight, Sphere
from hybrid_rt.core import fingerprint as fingerprints
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


MODULE = """
import dataclasses, enum, functools, logging, math
import numba
import numpy as np
import helpers
from helpers import halved

GAIN = 1.0
TABLE = np.arange(3.0)
log = logging.getLogger("some")

def scaled(x):
    return GAIN * x

@functools.lru_cache
def cached(x):
    return scaled(x)

@numba.njit
def kernel(x):
    return 2 * x

class Base:
    __slots__ = ("a",)
    kind = 1

    @property
    def double(self):
        return 2

    @staticmethod
    def tripled(x):
        return 3 * x

@dataclasses.dataclass(frozen=True)
class Thing(Base):
    size: float = 4.0

    def used(self):
        log.info("used")
        return [scaled(i) for i in range(5)] + [Thing, again, TABLE]

class Colour(enum.Enum):
    RED = 6

def again():
    return texture

def local():
    import helpers as own
    return own.quartered(8)

def texture(u, v):
    return Thing().used(), Colour.RED, kernel(u), cached(v), math.pi, helpers.quartered, halved
"""
HELPERS = """
def halved(x):
    return x / 7

def quartered(x):
    return halved(halved(x))

def unused():
    return 9
"""


def made(monkeypatch, names=("texture",), **changes):
    """Run the modules as a user's, with other digits; return the fingerprint of what has a name."""
    for module, text in (("helpers", HELPERS), ("user", MODULE)):
        code = text
        for old, new in changes.items():
            code = code.replace(old[1:], new)
        monkeypatch.setitem(sys.modules, module, types.ModuleType(module))
        exec(code, vars(sys.modules[module]))  # noqa: S102
    return fingerprint([vars(sys.modules["user"])[name] for name in names])


def test_functions_and_classes_of_ones_own_count_with_what_they_refer_to(monkeypatch):
    """Each digit of the modules but the last is used by the function, over however many steps."""
    as_is = made(monkeypatch)
    assert made(monkeypatch) == as_is  # other objects with the same contents
    digits = ["1.0", "2 * x", "= 1\n", "return 2", "3 * x", "4.0", "range(5)", "6\n", "/ 7"]
    for digit in [*digits, "arange(3.0)"]:
        changed = digit.translate(str.maketrans("1234567", "8888888"))
        assert made(monkeypatch, **{f"_{digit}": changed}) != as_is, digit
    assert made(monkeypatch, **{"_return 9": "return 8"}) == as_is
    assert made(monkeypatch, ("Thing", "again")) != made(monkeypatch, ("again", "Thing"))
    local = made(monkeypatch, ("local",))
    assert made(monkeypatch, ("local",), **{"_/ 7": "/ 8"}) != local


def test_what_functions_use_is_refused_by_name_if_nobody_can_tell():
    names = {"__name__": "user", "LOCK": threading.Lock()}
    exec("class Own:\n    def locked(self):\n        return LOCK", names)  # noqa: S102
    words = "function Own.locked uses LOCK, a lock, which cannot be compared"
    with pytest.raises(TypeError, match=words):
        fingerprint(names["Own"]())


def test_of_installed_packages_the_file_counts(tmp_path, monkeypatch):
    """They are not followed: they refer to thousands of others, and have versions."""
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path))
    found = []
    for text in ("f = lambda x: x", "f = lambda x: x  #", "f = lambda x: x"):
        (tmp_path / "installed.py").write_text(text)
        module = types.ModuleType("installed")
        module.__file__ = str(tmp_path / "installed.py")
        monkeypatch.setitem(sys.modules, "installed", module)
        exec(text, vars(module))  # noqa: S102
        fingerprints._file_of.cache_clear()
        found.append(fingerprint(module.f))
    fingerprints._file_of.cache_clear()
    assert found[0] == found[2] != found[1]
