"""The plan: which features a scene needs, decided once; features it does not need cost nothing."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.scene.touching import touching
from hybrid_rt.shading.kernels.light_kinds import WITHOUT_AREA
from hybrid_rt.shading.kernels.lobes.register import DELTA, FOLLOWED, SPREADS, TRANSMITS, WIDE
from hybrid_rt.textures.table import needs_lookup


class Needs(Protocol):
    """What an integrator does in any scene; see `hybrid_rt.integrators.declaration`."""

    @property
    def asks_every_light(self) -> bool:
        """Whether every light is sampled at each hit, instead of one."""

    @property
    def follows_every_branch(self) -> bool:
        """Whether both the reflected and the refracted ray are followed, not one at random."""

    @property
    def without_light_paths(self) -> str:
        """Why light subpaths are not used; "": they are."""

    @property
    def sends_photons(self) -> bool:
        """Whether photons are traced."""

    @property
    def follows_single_paths(self) -> bool:
        """Whether a path can be followed to its end before the next one begins."""

    @property
    def keeps_caustic_map(self) -> bool:
        """Whether caustic photons are kept in a map of their own."""


@dataclass
class Plan:
    """Decisions by name, each with its reason as text."""

    used: dict[str, str] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    def decide(self, name: str, is_needed: bool, because: str, otherwise: str) -> None:
        """Record one decision and its reason; a later decision replaces an earlier one."""
        self.used.pop(name, None)
        self.left_out.pop(name, None)
        (self.used if is_needed else self.left_out)[name] = because if is_needed else otherwise

    def __getitem__(self, name: str) -> bool:
        """Tell whether something is needed; an unknown name is a mistake of ours."""
        if name not in self.used and name not in self.left_out:
            raise KeyError(name)
        return name in self.used

    def as_dict(self) -> dict[str, Any]:
        """Return the plan for the report."""
        return {"used": dict(self.used), "left_out": dict(self.left_out)}


def explain(plan: dict[str, Any]) -> str:
    """Format the plan of a report, one decision a line."""
    lines = []
    for part, decisions in plan.items():
        lines.append(f"{part}:")
        for sign, group in (("+", "used"), ("-", "left_out")):
            lines += [f"  {sign} {name}: {why}" for name, why in decisions[group].items()]
    return "\n".join(["Plan (+ used, - left out)", *lines])


def make_plan(scene: CompiledScene, integrator: Needs, left_out: Sequence[str] = ()) -> Plan:
    """Decide which features light transport in this scene needs.

    ``left_out``: the light of the scene that the integrator does not find.
    """
    traits = scene.lobes.traits
    spreads = bool((traits & SPREADS).any())
    is_glass = (traits & TRANSMITS) != 0
    has_sky = scene.environment is not None
    n_lights = scene.n_lights
    asks_all = integrator.asks_every_light

    plan = Plan()
    plan.decide(
        "lens samples",
        scene.camera.has_lens,
        f"the lens has diameter {2.0 * scene.camera.reach:g}",
        "the camera has no lens",
    )
    plan.decide(
        "texture lookups",
        needs_lookup(scene.textures, scene.lobes.texture),
        "at least one colour varies over its surface",
        "all colours that surfaces reflect are constant",
    )
    how = "one shadow ray each" if asks_all else "one asked by a shadow ray (ppm: or by several)"
    plan.decide(
        "light samples",
        spreads and n_lights > 0,
        f"{n_lights} light(s), {how} per shading point and pass",
        "there is no light" if n_lights == 0 else "no surface spreads light",
    )
    plan.decide(
        "points on surfaces",
        spreads and bool(scene.shining),
        f"{len(scene.shining)} surface(s) shine and are asked by area",
        "no surface spreads light"
        if scene.shining
        else "no curved or trimmed surface, mesh or box shines",
    )
    how = "one shadow ray per shading point and pass" if asks_all else "one light among the others"
    plan.decide(
        "sky samples",
        spreads and has_sky,
        f"the environment shines on surfaces, {how}",
        "no surface spreads light" if has_sky else "the environment is black",
    )
    plan.decide(
        "visible lights",
        bool((scene.light_of >= 0).any()),
        "area lights are seen by camera and scattered rays",
        "no light has an area",
    )
    plan.decide(
        "mirror rays",
        bool((traits[~is_glass] & FOLLOWED).any()),
        "at least one surface is a mirror or metal",
        "no surface is a mirror",
    )
    plan.decide(
        "glass rays",
        bool(is_glass.any()),
        "at least one surface is a dielectric; "
        + ("both branches are" if integrator.follows_every_branch else "one branch is")
        + " followed",
        "no surface is a dielectric",
    )
    plan.decide(
        "rough glass",
        bool((traits[is_glass] & SPREADS).any()),
        "at least one clear body is rough: lights are sampled through its surface",
        "no clear body is rough" if is_glass.any() else "no surface is a dielectric",
    )
    plan.decide(
        "medium stack",
        bool(is_glass.any()),
        "rays remember the clear bodies they are in",
        "no surface is a dielectric",
    )
    plan.decide(
        "contacts",
        bool(is_glass.any()) and bool(touching(scene).any()),
        "clear bodies may touch other surfaces: what both share is passed at once",
        "no clear body touches another surface" if is_glass.any() else "no surface is a dielectric",
    )
    _plan_rays(plan, scene, integrator)
    leads = bool((traits & DELTA).any() or scene.narrow_materials.any())
    shines = bool(scene.lights.emit.any())
    has_points = bool(np.isin(scene.lights.kind, WITHOUT_AREA).any())
    of_points = "what point and spot lights send that way is not found"
    plan.decide(
        "light paths",
        not integrator.without_light_paths and spreads and leads and shines,
        "area lights shine on surfaces by way of mirrors, metals and glass: paths from them find that"
        + (f"; {of_points}" if has_points else ""),
        integrator.without_light_paths
        if integrator.without_light_paths
        else "no surface spreads light"
        if not spreads
        else "no mirror, metal or glass throws light"
        if not leads
        else f"no light has an area; {of_points}"
        if has_points
        else "no light has an area",
    )
    if integrator.sends_photons:
        _plan_photons(plan, scene, integrator)
    else:
        plan.decide(
            "photons",
            bool(scene.lights.chance.any()),
            "a few estimate the image mean"
            + (" and the light that is not found" if left_out else "")
            + "; the picture holds none of them",
            "nothing shines",
        )
    return plan


def _plan_rays(plan: Plan, scene: CompiledScene, integrator: Needs) -> None:
    """Decide whether rays are traced one by one or in batches."""
    reasons = {
        "the integrator follows many rays at once": not integrator.follows_single_paths,
        "clear bodies may touch other surfaces": plan["contacts"],
        "points of a lamp are chosen for many rays at once": bool(scene.shining),
    }
    why = next((reason for reason, holds in reasons.items() if holds), "")
    plan.decide(
        "single rays", not why, "behind the camera's rays, paths are followed one by one", why
    )


def _plan_photons(plan: Plan, scene: CompiledScene, integrator: Needs) -> None:
    """Decide which photons a scene needs."""
    traits, shines = scene.lobes.traits, bool(scene.lights.chance.any())
    gathers, throws = bool((traits & WIDE).any()), bool((traits & FOLLOWED).any())
    plan.decide(
        "photons",
        gathers and shines,
        "lights send photons to surfaces that spread light",
        "no surface spreads light widely" if shines else "nothing shines",
    )
    plan.decide(
        "aimed photons",
        gathers and shines and throws,
        "mirrors, metals or glass may throw caustics",
        "nothing mirrors or refracts" if gathers and shines else "there are no photons",
    )
    if integrator.keeps_caustic_map:
        plan.decide(
            "caustic map",
            gathers and shines and throws,
            "photons straight from mirrors, metals and glass are kept apart",
            "nothing mirrors or refracts" if gathers and shines else "there are no photons",
        )
