"""The methods of a comparison: an integrator with its options, accuracy and mesh tolerance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from hybrid_rt.core import checks
from hybrid_rt.integrators import INTEGRATORS, Options
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.scene import Scene

# Tolerances of meshes, relative to the diagonal of all curved surfaces.
TOLERANCES = (1e-2, 1e-3, 1e-4)


@dataclass(frozen=True)
class Method:
    """One way to render a picture; the number of passes varies along its curve."""

    name: str
    integrator: str
    accuracy: str = "certified"
    tolerance: float | None = None
    options: Options | None = None

    @property
    def flags(self) -> str:
        """The command-line options of ``hybrid-rt render`` for this method."""
        flags = [f"--integrator {self.integrator}"]
        if self.accuracy != "certified":
            flags.append(f"--accuracy {self.accuracy}")
        if self.tolerance is not None:
            flags.append(f"--tolerance {self.tolerance:.6g}")
        if self.options is not None and self.options.as_flags:
            flags.append(self.options.as_flags)
        return " ".join(flags)

    @property
    def power(self) -> float:
        """The asymptotic rate k: the squared error falls as passes ** -k."""
        return (self.options or INTEGRATORS[self.integrator].options()).error_power


def curved_surfaces(scene: Scene) -> list[Any]:
    """Return the free-form surfaces of a scene: patches, surfaces of revolution."""
    return [item.surface for item in scene.objects if item.surface.is_freeform]


def size_of(surfaces: Sequence[Any]) -> float:
    """Return the diagonal of the box around surfaces."""
    low = np.min([s.bounds[0] for s in surfaces], axis=0)
    high = np.max([s.bounds[1] for s in surfaces], axis=0)
    return float(np.linalg.norm(high - low))


def default_methods(
    scene: Scene,
    integrators: Sequence[str] | None = None,
    settings: Mapping[str, Sequence[Any]] | None = None,
) -> list[Method]:
    """Return integrators, by default all that can render the scene, with certified hits.

    ``settings`` are values to try by flag name, in all combinations, for integrators that have them. Raises
    ValueError if an integrator is unknown, refuses the scene, or a setting is out of range.
    """
    names: list[str] = [name for name in INTEGRATORS if _refusal(scene, name) is None]
    if integrators is not None:
        names = list(dict.fromkeys(integrators))
        for name in names:
            checks.choice(name, "integrator", INTEGRATORS)
            refusal = _refusal(scene, name)
            if refusal is not None:
                raise refusal
    return [method for name in names for method in _with_settings(name, settings or {})]


def _with_settings(integrator: str, settings: Mapping[str, Sequence[Any]]) -> list[Method]:
    """Return an integrator once for each combination of the settings that it has."""
    declared = INTEGRATORS[integrator]
    flags = [flag for flag in declared.options.flags().values() if settings.get(flag.name)]
    methods = []
    for values in product(*(settings[flag.name] for flag in flags)):
        words = [flag.in_words.format(value) for flag, value in zip(flags, values, strict=True)]
        asked = {flag.name: value for flag, value in zip(flags, values, strict=True)}
        options = declared.with_settings(asked)
        methods.append(Method(", ".join([integrator, *words]), integrator, options=options))
    return methods


def uncertified_methods(scene: Scene, certified: Method) -> list[Method]:
    """Return a method at accuracy "refined" and "mesh", if a surface of the scene is curved."""
    surfaces = curved_surfaces(scene)
    if not surfaces:
        return []
    # As a command line would write them, so that a printed command is what was measured.
    tolerances = [float(f"{share * size_of(surfaces):.6g}") for share in TOLERANCES]
    name = certified.name
    return [
        replace(certified, name=f"{name}, refined", accuracy="refined"),
        *(
            replace(certified, name=f"{name}, mesh {t:.2g}", accuracy="mesh", tolerance=t)
            for t in tolerances
        ),
    ]


def finds_all_light(scene: Scene, integrator: str, options: Options | None = None) -> bool:
    """Tell whether an integrator's pictures of a scene converge to the full solution.

    They do not if it misses light paths, its blur stays, or it cannot render the scene.
    """
    declared = INTEGRATORS[integrator]
    own = options or declared.options()
    if own.blur_stays or _refusal(scene, integrator) is not None:
        return False
    return not declared.left_out_light(compile_scene(scene), own)


def _refusal(scene: Scene, integrator: str) -> ValueError | None:
    """Return why an integrator refuses a scene, or None."""
    try:
        INTEGRATORS[integrator].refuse(compile_scene(scene))
    except ValueError as error:
        return error
    return None
