"""Light paths in Heckbert's notation, and which paths of a scene an integrator does not find.

Heckbert, "Adaptive radiosity textures for bidirectional ray tracing", SIGGRAPH 1990: a path is a
word that begins with a light and ends in the eye. Here

- ``L`` is an area light, ``P`` a point or spot light, ``U`` an emissive infinite plane, which
  cannot be sampled by area, ``K`` the environment;
- ``D`` is a wide lobe (diffuse, glossy), ``G`` a narrow lobe (metal, rough glass), ``S`` a delta
  lobe (mirror, smooth glass);
- ``E`` is the eye.

So ``[LK]D[GS]*E`` is direct light on diffuse surfaces, seen also in mirrors. Point and spot lights
are invisible, also in mirrors: ``PS*E`` is no path.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.light_kinds import WITHOUT_AREA
from hybrid_rt.shading.kernels.lobes.register import DELTA, NARROW, WIDE

# Every kind of path that integrators differ in shows in as many surfaces.
MOST_SURFACES = 4


def _paths(lights: str, surfaces: str, most: int = MOST_SURFACES) -> list[str]:
    """Return all paths over these letters, the shortest first."""
    words = (word for n in range(most + 1) for word in product(lights, *[surfaces] * n))
    return [f"{''.join(word)}E" for word in words if not re.fullmatch("PS*", "".join(word))]


ALL_PATHS = _paths("LPUK", "DGS")

# Paths and what they are called: the first that fits.
NAMES = (
    ("[LUK][GS]*E", "light that the camera sees"),
    ("PS+[DGS]*E", "light of lamps without area that mirrors or glass throw onto surfaces"),
    ("[LUK]S+[DGS]*E", "light that mirrors or glass throw onto surfaces"),
    ("PG[GS]*E", "highlights of lamps without area on metal"),
    ("PD[GS]*E", "light straight from lamps without area"),
    ("UD[GS]*E", "light straight from planes that shine"),
    (".[DG][GS]*E", "light straight from lamps or the sky"),
    (".*", "light that goes from surface to surface"),
)
SEEN, STRAIGHT, ARRIVES = "that the camera sees", "lamps or the sky", "light straight from"
LIGHTS = {
    "L": "lamps with area", "P": "lamps without area", "U": "planes that shine", "K": "the sky",
}  # fmt: skip
# Where all that is missing of "... throw onto surfaces" ends on lobes of one kind, these are named.
ONTO_ANY, ONTO_WIDE = "onto surfaces", "onto matt or glossy surfaces"
ONTO_NARROW = "onto metal or rough glass"
# How the camera sees a surface: by which lobes.
SIGHTS = {
    frozenset("E"): "directly",
    frozenset("S"): "in mirrors and smooth glass",
    frozenset("G"): "in metal and rough glass",
    frozenset("SG"): "in mirrors, metal and glass",
    frozenset("ES"): "directly and in mirrors and smooth glass",
    frozenset("EG"): "directly and in metal and rough glass",
}


def paths_of(scene: CompiledScene) -> list[str]:
    """Return the light paths that a scene's lights and materials allow."""
    shines = scene.lights.strength.any(axis=1)
    present = set(letters_of_lights(scene)[shines].tolist())
    lights, surfaces = "".join(letter for letter in "LPU" if letter in present), ""
    lights += "" if scene.environment is None else "K"
    for letter, traits in (("D", WIDE), ("G", NARROW), ("S", DELTA)):
        surfaces += letter if scene.lobes_with(traits).any() else ""
    return _paths(lights, surfaces, 1 if _is_one_flat_surface(scene) else MOST_SURFACES)


def letters_of_lights(scene: CompiledScene) -> NDArray[np.str_]:
    """Return the letter of each light of the table, (lights,)."""
    has_no_area = np.isin(scene.lights.kind, WITHOUT_AREA)
    has_no_end = ~has_no_area & (scene.lights.chance[:-1] == 0.0)
    return np.where(has_no_area, "P", np.where(has_no_end, "U", "L"))


def left_out(found: str, paths: Iterable[str]) -> list[str]:
    """Return a sentence for each kind of path that is not found, with the shortest as examples.

    ``paths``, iterable of str.
    ``found``: regular expression of the paths that are found.
    """
    missing: dict[str, list[str]] = {}
    others: dict[str, list[str]] = {}
    for path in paths:
        name = next(name for pattern, name in NAMES if re.fullmatch(pattern, path))
        (others if re.fullmatch(found, path) else missing).setdefault(name, []).append(path)
    return [
        f"{_narrowed(name, words, others.get(name, ()))} ({_examples(words)})"
        for name, words in missing.items()
    ]


def _narrowed(name: str, missing: Sequence[str], found: Sequence[str]) -> str:
    """Return the name of paths that are missing, narrowed down where others of that name are found.

    It then says whose light it is, on which lobes it ends and how the camera sees these, each if that
    differs between what is missing and all paths. Where some found paths fit such a name as well, it
    begins with "part of the".
    """
    lights, ends, sights = values = [{trait(path) for path in missing} for trait in TRAITS]
    of_found = [[trait(path) for trait in TRAITS] for path in found]
    is_same = [values[i].issuperset(traits[i] for traits in of_found) for i in range(len(TRAITS))]
    if not is_same[0]:
        *several, last = [text for letter, text in LIGHTS.items() if letter in lights]
        of = f"{', '.join(several)} or {last}" if several else last
        name = name.replace(STRAIGHT, of).replace("light that", f"light of {of} that")
    if ends == {"narrow"}:
        name = name.replace(ONTO_ANY, ONTO_NARROW)
    elif not is_same[1]:
        name = name.replace(ONTO_ANY, ONTO_WIDE)
    if not is_same[2]:
        seen = ", on surfaces seen" if name.startswith(ARRIVES) else ", as seen"
        name += f"{'' if name.endswith(SEEN) else seen} {SIGHTS[frozenset(sights)]}"
    elif name.endswith(SEEN):
        name += ", also in mirrors, metal and glass"
    is_part = any(a in lights and b in ends and c in sights for a, b, c in of_found)
    return f"part of the {name}" if is_part else name


def _light(path: str) -> str:
    return path[0]


def _end(path: str) -> str:
    """Return whether light of a path comes to a wide lobe, or to narrow ones alone."""
    return "wide" if "D" in path else "narrow"


def _sight(path: str) -> str:
    """Return by which lobes the camera sees the last wide one, else the first narrow one or the light.

    "G": a narrow one at least; "S": delta lobes alone; "E": none.
    """
    last = re.sub("^(.*D|[LUK]|PS*G)", "", path)
    return "G" if "G" in last else last[0]


TRAITS = (_light, _end, _sight)


def _examples(paths: Sequence[str]) -> str:
    shortest = [path for path in paths if len(path) == len(paths[0])]
    return ", ".join(shortest[:3]) + (", ..." if len(paths) > len(shortest[:3]) else "")


def _is_one_flat_surface(scene: CompiledScene) -> bool:
    """Tell whether nothing that light leaves can meet another surface that sends it on."""
    objects = np.flatnonzero(scene.material_of != NOTHING)
    return objects.size == 1 and scene.surfaces[objects[0]].is_flat
