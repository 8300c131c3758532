"""All faults of a scene, as a report has them."""

from __future__ import annotations

from dataclasses import dataclass

from hybrid_rt.intersection import Intersector
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.scene.lint.in_one_plane import surfaces_in_one_plane
from hybrid_rt.scene.lint.lamps_in_bodies import LampInBody, lamps_in_bodies
from hybrid_rt.scene.lint.lamps_turned_away import lamps_turned_away
from hybrid_rt.scene.lint.narrow_view import narrow_view
from hybrid_rt.scene.lint.overlapping import overlapping_bodies
from hybrid_rt.scene.lint.pictures_on_meshes import pictures_on_meshes


@dataclass(frozen=True)
class Faults:
    """The faults of a scene: names of lamps, objects and bodies, or pairs of them.

    ``narrow_view`` is the field of view in degrees, if no object fits into it as if radians had been
    meant. Each is explained in the module of its name.
    """

    lamps_turned_away: list[str]
    pictures_turned_away: list[str]
    lamps_in_bodies: list[LampInBody]
    surfaces_in_one_plane: list[list[str]]
    clear_bodies_overlap: list[list[str]]
    pictures_on_meshes: list[str]
    narrow_view: float | None


def faults_of(scene: CompiledScene, tracer: Intersector) -> Faults:
    """Return the faults of a scene whose lamps are lifted out of the surfaces in which they lie."""
    return Faults(
        *lamps_turned_away(scene),
        lamps_in_bodies(scene),
        surfaces_in_one_plane(scene),
        overlapping_bodies(scene, tracer),
        pictures_on_meshes(scene),
        narrow_view(scene),
    )
