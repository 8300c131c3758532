"""Ways to make one picture: what they are called, how a command asks for them, what they can do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.core import checks
from hybrid_rt.integrators import INTEGRATORS, OPTIONS, PPMOptions
from hybrid_rt.integrators.photons.photon_tracer import check_lights
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.plan import WITH_PHOTONS
from hybrid_rt.scene.scene import Scene
from hybrid_rt.shading.kernels.emitter import POINT
from hybrid_rt.shading.kernels.lobes.register import DELTA
from meshing import BezierPatches, SurfaceOfRevolution

# Tolerances of meshes, relative to the diagonal of all curved surfaces.
TOLERANCES = (1e-2, 1e-3, 1e-4)


@dataclass(frozen=True)
class Method:
    """One way to make a picture; what varies along its curve is the number of passes."""

    name: str
    integrator: str
    accuracy: str = "certified"
    tolerance: float | None = None
    options: Any = None

    @property
    def flags(self) -> str:
        """The options of ``hybrid-rt render`` that choose it."""
        flags = [f"--integrator {self.integrator}"]
        if self.accuracy != "certified":
            flags.append(f"--accuracy {self.accuracy}")
        if self.tolerance is not None:
            flags.append(f"--tolerance {self.tolerance:.3g}")
        if self.integrator in WITH_PHOTONS and self.options is not None:
            flags.append(f"--photons {self.options.photons_per_pass}")
            if isinstance(self.options, PPMOptions) and self.options.alpha != PPMOptions.alpha:
                flags.append(f"--alpha {self.options.alpha:.6g}")
        return " ".join(flags)

    @property
    def power(self) -> float:
        """How fast the square of the error falls in the end: as passes to the minus this.

        Of noise it is one; of progressive photon mapping see `PPMOptions.error_power`.
        """
        if self.integrator != "ppm":
            return 1.0
        options: PPMOptions = self.options or PPMOptions()
        return options.error_power


def curved_surfaces(scene: Scene) -> list[Any]:
    """Return the patches and surfaces of revolution of a scene."""
    kinds = BezierPatches | SurfaceOfRevolution
    return [item.surface for item in scene.objects if isinstance(item.surface, kinds)]


def size_of(surfaces: Sequence[Any]) -> float:
    """Return the diagonal of the box around surfaces."""
    low = np.min([s.bounds[0] for s in surfaces], axis=0)
    high = np.max([s.bounds[1] for s in surfaces], axis=0)
    return float(np.linalg.norm(high - low))


def default_methods(
    scene: Scene,
    integrators: Sequence[str] | None = None,
    photons: Sequence[int] = (),
    alphas: Sequence[float] = (),
) -> list[Method]:
    """Return integrators with certified hits, and paths on what is not certified.

    Parameters
    ----------
    scene : Scene
    integrators : sequence of str, optional
        By default all, but for those that refuse the scene.
    photons : sequence of int
        Photons of a pass, for each method that has any; none: its own default.
    alphas : sequence of float
        `PPMOptions.alpha`; every one with each number of photons.

    Raises
    ------
    ValueError
        If an integrator is unknown, refuses the scene, or a setting is out of range.
    """
    names: list[str] = [name for name in INTEGRATORS if _refusal(scene, name) is None]
    if integrators is not None:
        names = list(dict.fromkeys(integrators))
        for name in names:
            checks.choice(name, "integrator", INTEGRATORS)
            refusal = _refusal(scene, name)
            if refusal is not None:
                raise refusal
    methods = [method for name in names for method in _with_options(name, photons, alphas)]
    return methods + (uncertified_methods(scene) if "path" in names else [])


def _with_options(integrator: str, photons: Sequence[int], alphas: Sequence[float]) -> list[Method]:
    """Return an integrator once for each combination of the settings that it has."""
    kind = OPTIONS[integrator]
    if integrator not in WITH_PHOTONS or kind is None:
        return [Method(integrator, integrator)]
    methods = []
    for n in photons or (None,):
        for alpha in (alphas if integrator == "ppm" else ()) or (None,):
            given = {"photons_per_pass": n, "alpha": alpha}
            given = {key: value for key, value in given.items() if value is not None}
            words = [integrator]
            words += [] if n is None else [f"{n} photons"]
            words += [] if alpha is None else [f"alpha {alpha:.3g}"]
            options = kind(**given) if given else None
            methods.append(Method(", ".join(words), integrator, options=options))
    return methods


def uncertified_methods(scene: Scene) -> list[Method]:
    """Return paths after Newton alone, and on meshes; nothing where no surface is curved."""
    surfaces = curved_surfaces(scene)
    if not surfaces:
        return []
    tolerances = [share * size_of(surfaces) for share in TOLERANCES]
    return [
        Method("path, refined", "path", "refined"),
        *(Method(f"path, mesh {t:.2g}", "path", "mesh", t) for t in tolerances),
    ]


def finds_all_light(scene: Scene, integrator: str) -> bool:
    """Tell whether an integrator's pictures of a scene have the whole light as their limit.

    Paths miss what mirrors and glass make of a light without area; photons cannot be sent to what
    has no end; Whitted's method leaves out light by way of surfaces that spread it.
    """
    if integrator in WITH_PHOTONS:
        # The blur of a photon map stays.
        return integrator == "ppm" and _refusal(scene, integrator) is None
    if integrator != "path":
        return False
    compiled = compile_scene(scene)
    throws = bool((compiled.lobes.traits & DELTA).any())
    return not (throws and bool((compiled.lights.kind == POINT).any()))


def _refusal(scene: Scene, integrator: str) -> ValueError | None:
    """Return why an integrator refuses a scene, or None."""
    if integrator in WITH_PHOTONS:
        try:
            check_lights(compile_scene(scene))
        except ValueError as error:
            return error
    return None
