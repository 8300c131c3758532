"""Settings of integrators, checked before any work, and what follows from them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, fields
from typing import Any

from hybrid_rt.core import checks

WAYS = ("both", "lights", "directions")
# Far more photons than any machine holds, which `hybrid_rt.rendering.memory` says in time.
MOST = 10**15
# Directions of one path: as good as no end.
DEEPEST = 10**6


@dataclass(frozen=True)
class Flag:
    """How command lines ask for a setting, and messages name it."""

    name: str
    """"photons": the flag is ``--photons``."""
    type: type
    metavar: str
    help: str
    """``{}`` stands for the integrators that have the setting."""
    in_words: str
    """How the setting is told among others: "{} photons"."""
    form: str = "{}"
    """How its value is written."""


def setting(default: Any, flag: Flag) -> Any:
    """Return a field of `Options` that command lines can ask for."""
    return field(default=default, metadata={"flag": flag})


@dataclass(frozen=True)
class Options:
    """Settings of an integrator, and what follows from them; these are those of one without any."""

    @property
    def n_photons(self) -> int:
        """Photons that leave the lights in each pass; 0: the integrator has none."""
        return 0

    @property
    def error_power(self) -> float:
        """How fast the square of the error falls in the end: as passes to the minus this."""
        return 1.0

    @property
    def blur_stays(self) -> bool:
        """Whether the picture stays blurred however many passes there are."""
        return False

    @classmethod
    def flags(cls) -> dict[str, Flag]:
        """Return the flags of those settings that have one, by the settings' names."""
        return {f.name: f.metadata["flag"] for f in fields(cls) if "flag" in f.metadata}

    @property
    def as_flags(self) -> str:
        """What a command line says for settings that are not the default, as far as it can."""
        defaults = {f.name: f.default for f in fields(self)}
        given = [
            f"--{flag.name} {flag.form.format(getattr(self, name))}"
            for name, flag in self.flags().items()
            if getattr(self, name) != defaults[name]
        ]
        return " ".join(given)


@dataclass(frozen=True)
class PathOptions(Options):
    """Settings of the integrator "path".

    Attributes
    ----------
    strategy : "both", "lights" or "directions"
        How direct light is found: by next-event estimation ("lights"), by BSDF sampling
        ("directions"), or by both, weighted by the power heuristic. The first two alone are for
        comparison; "lights" does not find what mirrors and glass throw on other surfaces, and
        "directions" finds no point lights.
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
        checks.choice(self.strategy, "PathOptions strategy", WAYS)
        checks.whole(self.roulette_depth, "PathOptions roulette_depth", at_least=0, up_to=DEEPEST)
        checks.number(self.light_paths, "PathOptions light_paths", at_least=0.0, hint="0: none")
        checks.number(self.survival, "PathOptions survival", above=0.0, up_to=1.0)


PHOTONS = Flag("photons", int, "N", "photons of a pass ({})", "{} photons")
ALPHA = Flag(
    "alpha", float, "A", "how slowly discs shrink ({}; default 2/3)", "alpha {:.3g}", "{:.6g}"
)


@dataclass(frozen=True)
class PPMOptions(Options):
    """Settings of the integrator "ppm".

    Attributes
    ----------
    photons_per_pass : int
        From 1 on: photons that leave all lights together in a pass, shared out by power. Each light
        sends two at least, one of them aimed where there is something to aim at.
    alpha : float
        Between 0 and 1: how slowly the discs that photons are gathered on shrink. At 1 they never
        do: noise falls fastest, but the blur stays, which a warning says.
    initial_radius : float, optional
        Scene units, between a millionth and a quarter of the diagonal of the box around all
        surfaces that end: of the discs in the first pass. By default it depends on how densely
        photons fall around each point.
    """

    photons_per_pass: int = setting(200_000, PHOTONS)
    alpha: float = setting(2.0 / 3.0, ALPHA)
    initial_radius: float | None = None

    def __post_init__(self) -> None:
        """Refuse what is out of range."""
        checks.whole(self.photons_per_pass, "PPMOptions photons_per_pass", at_least=1, up_to=MOST)
        checks.number(self.alpha, "PPMOptions alpha", above=0.0, up_to=1.0)
        if self.alpha == 1.0:
            warnings.warn(
                "PPMOptions alpha: at 1 the discs never shrink, so the picture stays blurred "
                "however many passes there are",
                stacklevel=3,
            )
        if self.initial_radius is not None:
            checks.number(self.initial_radius, "PPMOptions initial_radius", above=0.0)

    @property
    def n_photons(self) -> int:
        """Photons that leave the lights in each pass."""
        return self.photons_per_pass

    @property
    def error_power(self) -> float:
        """How fast the square of the error falls in the end: as passes to the minus this.

        The discs shrink, so the noise falls as passes^-alpha and the square of the blur as
        passes^(2 alpha - 2) (Knaus and Zwicker, 2011): the slower one stays. At alpha = 1 the blur
        does not fall at all; this is about the rest.
        """
        return float(min(self.alpha, 2.0 - 2.0 * self.alpha)) if self.alpha < 1.0 else 1.0

    @property
    def blur_stays(self) -> bool:
        """Whether the discs never shrink."""
        return self.alpha == 1.0


@dataclass(frozen=True)
class PhotonMapOptions(Options):
    """Settings of the integrator "photon_map".

    Attributes
    ----------
    photons_per_pass : int
        From 1 on: photons that leave all lights together; each pass has its own. Each light sends
        two at least, as for `PPMOptions`.
    nearest : int
        From 2 on: photons that an estimate is made from. More of them blur, fewer are noisy.
    """

    photons_per_pass: int = setting(500_000, PHOTONS)
    nearest: int = 60

    def __post_init__(self) -> None:
        """Refuse what is out of range."""
        checks.whole(
            self.photons_per_pass, "PhotonMapOptions photons_per_pass", at_least=1, up_to=MOST
        )
        checks.whole(self.nearest, "PhotonMapOptions nearest", at_least=2, up_to=MOST)

    @property
    def n_photons(self) -> int:
        """Photons that leave the lights in each pass."""
        return self.photons_per_pass

    @property
    def blur_stays(self) -> bool:
        """It does: the discs hold as many photons in every pass."""
        return True
