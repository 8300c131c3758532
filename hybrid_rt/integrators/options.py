"""Settings of single integrators, checked before any work."""

from __future__ import annotations

from dataclasses import dataclass

from hybrid_rt import checks

WAYS = ("both", "lights", "directions")


@dataclass(frozen=True)
class PathOptions:
    """Settings of the integrator "path".

    Attributes
    ----------
    strategy : "both", "lights" or "directions"
        How light is found: by asking one light per hit, by running into it, or both ways, weighted
        against each other. The first two alone are for comparison; "lights" does not find what
        mirrors and glass throw on other surfaces, and "directions" finds no point lights.
    roulette_depth : int
        Directions that every path takes before chance may end it.
    survival : float
        Above 0 and at most 1: largest probability to go on after that. At 1 a path in a closed
        white room ends at ``max_depth`` only.
    light_paths : float
        Paths from lamps for each camera ray: they find what mirrors and glass throw. 0 leaves it
        to camera paths, which find it by chance. Only with "both".
    """

    strategy: str = "both"
    roulette_depth: int = 3
    survival: float = 0.99
    light_paths: float = 0.5

    def __post_init__(self) -> None:
        """Refuse what is out of range."""
        if self.strategy not in WAYS:
            raise ValueError(
                f"PathOptions strategy {self.strategy!r} is unknown; use {', '.join(WAYS)}"
            )
        checks.whole(self.roulette_depth, "PathOptions roulette_depth", at_least=0)
        if checks.number(self.light_paths, "PathOptions light_paths") < 0.0:
            raise ValueError(
                f"PathOptions light_paths: {self.light_paths:g} is negative; 0 sends none"
            )
        checks.number(self.survival, "PathOptions survival", above=0.0, up_to=1.0)
