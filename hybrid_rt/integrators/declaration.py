"""The declaration of an integrator: its constructor, its options, which light paths it finds.

Each integrator declares itself in the ``__init__`` of its package; `hybrid_rt.integrators` lists
all declarations. They import nothing that traces rays, so choosing one integrator does not load the
others.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from hybrid_rt.integrators.options import Options

if TYPE_CHECKING:
    from hybrid_rt.integrators.context import RenderContext
    from hybrid_rt.integrators.workers import Workers
    from hybrid_rt.scene.compiled import CompiledScene


@dataclass(frozen=True)
class OtherWay:
    """Settings by which an integrator finds the same light in another way, to check itself."""

    name: str
    options: Options


@dataclass(frozen=True)
class Declaration:
    """The public description of an integrator.

    Attributes
    ----------
    name : str
    make : callable
        Takes the context and the number of threads, returns the `Workers` of a render.
    finds : callable
        Takes the options, returns the light paths that the integrator finds: a regular expression
        in the notation of `hybrid_rt.integrators.light_found`; ".*" if what it returns is not radiance.
    options : type
        Class of its options.
    refuse : callable
        Raises ValueError for a scene that the integrator cannot render.
    other_way : OtherWay, optional
    asks_every_light : bool
        Sample every light at each hit, by one shadow ray each; else one light is sampled.
    follows_every_branch : bool
        Follow both the reflected and the refracted ray at glass; else one of them.
    without_light_paths : str
        Why it uses no light subpaths; "": it does.
    follows_single_paths : bool
        Where the surfaces allow it, follow each path to its end before the next one begins.
    sends_photons : bool
    keeps_caustic_map : bool
        Whether caustic photons are kept in a map of their own.
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
    follows_single_paths: bool = False
    sends_photons: bool = False
    keeps_caustic_map: bool = False

    def __post_init__(self) -> None:
        """Refuse what could not be called, and a ``finds`` that is no regular expression."""
        for what in ("make", "finds"):
            if not callable(getattr(self, what)):
                given = getattr(self, what)
                raise TypeError(f"Declaration {self.name!r}: {what} is {given!r}: pass a function")
        found = self.finds(self.options())
        try:
            re.compile(found)
        except (re.error, TypeError) as error:
            raise ValueError(
                f"Declaration {self.name!r}: finds returned {found!r}, which is no regular expression "
                f'({error}): pass one such as "[LPK][DG]E", or "" if it finds no light'
            ) from None

    def left_out_light(self, scene: CompiledScene, options: Options | None = None) -> list[str]:
        """Return which light of a scene the integrator does not find, one sentence for each kind.

        Empty if its pictures converge to the full solution, up to blur that stays.
        """
        from hybrid_rt.integrators.light_found import left_out, paths_of

        return left_out(self.finds(options or self.options()), paths_of(scene))

    def with_options(self, options: Options) -> Declaration:
        """Return the declaration with what these options leave out."""
        why = self.without_light_paths or options.without_light_paths
        return replace(self, without_light_paths=why)

    @property
    def finds_light_of_lamps(self) -> bool:
        """Whether pictures converge to all light of area lights, in any scene."""
        from hybrid_rt.integrators.light_found import ALL_PATHS, left_out

        options = self.options()
        of_lamps = [path for path in ALL_PATHS if path[0] == "L"]
        return not options.blur_stays and not left_out(self.finds(options), of_lamps)

    def with_settings(self, asked: dict[str, Any]) -> Options | None:
        """Return options from values by flag name; None if no value is given."""
        setting_of = {flag.name: setting for setting, flag in self.options.flags().items()}
        given = {setting_of[name]: value for name, value in asked.items()}
        return self.options(**given) if given else None
