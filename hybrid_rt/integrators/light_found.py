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
    ("[LUK][GS]*E", "light that the camera sees, also in mirrors, metal and glass"),
    ("PS+[DGS]*E", "light of lamps without area that mirrors or glass throw onto surfaces"),
    ("[LUK]S+[DGS]*E", "light that mirrors or glass throw onto surfaces"),
    ("PG[GS]*E", "highlights of lamps without area on metal"),
    ("PD[GS]*E", "light straight from lamps without area"),
    ("UD[GS]*E", "light straight from planes that shine"),
    (".[DG][GS]*E", "light straight from lamps or the sky"),
    (".*", "light that goes from surface to surface"),
)
# Where all that is missing of "... throw onto surfaces" ends on narrow lobes, these surfaces are named.
ONTO_ANY, ONTO_NARROW = "onto surfaces", "onto metal or rough glass"


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

    Parameters
    ----------
    found : str
        Regular expression of the paths that are found.
    paths : iterable of str
    """
    missing: dict[str, list[str]] = {}
    for path in paths:
        if not re.fullmatch(found, path):
            name = next(name for pattern, name in NAMES if re.fullmatch(pattern, path))
            missing.setdefault(name, []).append(path)
    return [f"{_narrowed(name, words)} ({_examples(words)})" for name, words in missing.items()]


def _narrowed(name: str, words: Sequence[str]) -> str:
    """Return the name, with the surfaces where the light is missing if these are of one kind."""
    return name if any("D" in word for word in words) else name.replace(ONTO_ANY, ONTO_NARROW)


def _examples(paths: Sequence[str]) -> str:
    shortest = [path for path in paths if len(path) == len(paths[0])]
    return ", ".join(shortest[:3]) + (", ..." if len(paths) > len(shortest[:3]) else "")


def _is_one_flat_surface(scene: CompiledScene) -> bool:
    """Tell whether nothing that light leaves can meet another surface that sends it on."""
    objects = np.flatnonzero(scene.material_of != NOTHING)
    return objects.size == 1 and scene.surfaces[objects[0]].is_flat
