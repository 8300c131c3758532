"""All faults of a scene, by the keys that a report has for them."""

from __future__ import annotations

from typing import Any

from hybrid_rt.intersection import Intersector
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.scene.lint.in_one_plane import surfaces_in_one_plane
from hybrid_rt.scene.lint.lamps_in_bodies import lamps_in_bodies
from hybrid_rt.scene.lint.lamps_turned_away import lamps_turned_away
from hybrid_rt.scene.lint.narrow_view import narrow_view
from hybrid_rt.scene.lint.overlapping import overlapping_bodies
from hybrid_rt.scene.lint.pictures_on_meshes import pictures_on_meshes


def faults_of(scene: CompiledScene, tracer: Intersector) -> dict[str, Any]:
    """Return the faults of a scene, by the keys that a report has for them.

    Parameters
    ----------
    scene : CompiledScene
        With its lamps lifted out of the surfaces in which they lie.
    tracer : Intersector
        Of its surfaces.
    """
    turned_away, pictures = lamps_turned_away(scene)
    return {
        "lamps_turned_away": turned_away,
        "pictures_turned_away": pictures,
        "lamps_in_bodies": lamps_in_bodies(scene),
        "surfaces_in_one_plane": surfaces_in_one_plane(scene),
        "clear_bodies_overlap": overlapping_bodies(scene, tracer),
        "pictures_on_meshes": pictures_on_meshes(scene),
        "narrow_view": narrow_view(scene),
    }
