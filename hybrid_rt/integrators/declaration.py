"""What an integrator says of itself: how it is made, what it needs of a scene, which light it finds.

A declaration stands in the ``__init__`` of its integrator's room, and `hybrid_rt.integrators` lists
them all. They import nothing that traces rays: whoever asks for one integrator does not load what
the others need.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hybrid_rt.integrators.options import Options

if TYPE_CHECKING:
    from hybrid_rt.integrators.context import RenderContext
    from hybrid_rt.integrators.workers import Workers
    from hybrid_rt.scene.compiled import CompiledScene


@dataclass(frozen=True)
class OtherWay:
    """Settings by which an integrator finds the same light by other means: it can check itself."""

    name: str
    options: Options


@dataclass(frozen=True)
class Declaration:
    """All that others know of an integrator.

    Attributes
    ----------
    name : str
    make : callable
        Makes the threads of a render, from the context and their number.
    finds : callable
        Returns, for settings, the light that the integrator finds: a regular expression over paths
        of light, in the letters of `hybrid_rt.integrators.light_found`.
    options : type
        Its settings.
    refuse : callable
        Raises ValueError for a scene that the integrator cannot render.
    other_way : OtherWay, optional
    asks_every_light : bool
        At each hit, by one shadow ray each; else one light is asked.
    follows_every_branch : bool
        What glass reflects and what it refracts; else one of them.
    without_light_paths : str
        Why it sends no paths from the lamps to join those of the camera; "": it does.
    sends_photons : bool
    keeps_caustic_map : bool
        Whether photons straight from mirrors and glass are kept apart from the others.
    """

    name: str
    make: Callable[[RenderContext, int], Workers]
    finds: Callable[[Any], str]
    options: type[Options] = Options
    refuse: Callable[[CompiledScene], None] = lambda _: None
    other_way: OtherWay | None = None
    asks_every_light: bool = False
    follows_every_branch: bool = False
    without_light_paths: str = ""
    sends_photons: bool = False
    keeps_caustic_map: bool = False

    def left_out_light(self, scene: CompiledScene, options: Options | None = None) -> list[str]:
        """Return what light of a scene the integrator does not find, a sentence for each kind.

        An empty list: its pictures have the whole light as their limit, but for blur that stays.
        """
        from hybrid_rt.integrators.light_found import left_out, paths_of

        return left_out(self.finds(options or self.options()), paths_of(scene))

    @property
    def finds_light_of_lamps(self) -> bool:
        """Whether pictures tend to all light of lamps that have an area, whatever the scene."""
        from hybrid_rt.integrators.light_found import ALL_PATHS, left_out

        options = self.options()
        of_lamps = [path for path in ALL_PATHS if path[0] == "L"]
        return not options.blur_stays and not left_out(self.finds(options), of_lamps)

    def with_settings(self, asked: dict[str, Any]) -> Options | None:
        """Return settings by the names of their flags; None where nothing is asked for."""
        setting_of = {flag.name: setting for setting, flag in self.options.flags().items()}
        given = {setting_of[name]: value for name, value in asked.items()}
        return self.options(**given) if given else None
