"""Options of integrators, checked on construction, and what follows from them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, fields
from typing import Any

from hybrid_rt.core import checks
from hybrid_rt.core.suggestions import explains

WAYS = ("both", "lights", "directions")
# Far more photons than any machine holds, which `hybrid_rt.rendering.memory` says in time.
MOST = 10**15
# Light subpaths per camera ray: on five scenes, 320 and 1280 pixels wide, the best or within 11 % of its squared
# noise times seconds.
LIGHT_PATHS_PER_RAY = 0.5
# Directions of one path: as good as no end.
DEEPEST = 10**6


@dataclass(frozen=True)
class Flag:
    """How a setting appears on the command line and in messages."""

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
    """Return a field of `Options` with a command-line flag."""
    return field(default=default, metadata={"flag": flag})


@dataclass(frozen=True)
class Options:
    """Base class of the options of an integrator; also the options of one without settings."""

    @property
    def n_photons(self) -> int:
        """Photons emitted per pass; 0 for integrators without photons."""
        return 0

    @property
    def error_power(self) -> float:
        """The asymptotic rate k: the squared error falls as passes ** -k."""
        return 1.0

    @property
    def blur_stays(self) -> bool:
        """Whether there is blur that more passes do not reduce."""
        return False

    @property
    def without_light_paths(self) -> str:
        """Why these options allow no light subpaths; "": they do."""
        return ""

    @property
    def samples_lights(self) -> bool:
        """Whether next-event estimation samples lights, not BSDF sampling alone."""
        return True

    @classmethod
    def flags(cls) -> dict[str, Flag]:
        """Return the command-line flags by setting name."""
        return {f.name: f.metadata["flag"] for f in fields(cls) if "flag" in f.metadata}

    @property
    def as_flags(self) -> str:
        """The command-line text for the non-default settings that have flags."""
        defaults = {f.name: f.default for f in fields(self)}
        given = [
            f"--{flag.name} {flag.form.format(getattr(self, name))}"
            for name, flag in self.flags().items()
            if getattr(self, name) != defaults[name]
        ]
        return " ".join(given)


LIGHT_PATHS = Flag(
    "light-paths",
    float,
    "N",
    "light subpaths per camera ray ({}; default 0.5)",
    "{:g} light paths",
    "{:g}",
)


@dataclass(frozen=True)
class PathOptions(Options):
    """Options of the integrator "path".

    Attributes
    ----------
    strategy : "both", "lights" or "directions"
        How direct light is found: by next-event estimation ("lights"), by BSDF sampling
        ("directions"), or by both with multiple importance sampling (power heuristic). The single
        strategies are for comparison: "lights" finds what comes by way of mirrors and smooth glass, caustics
        too, by chance alone; "directions" finds no point lights.
    roulette_depth : int
        Number of bounces before Russian roulette begins. A path then goes on with the probability of
        what it carries over what it carried at the vertex before.
    survival : float
        Largest survival probability of Russian roulette, above 0 and at most 1. At 1 a path in a
        closed white room ends only at ``max_depth``.
    light_paths : float
        Number of light subpaths per camera ray, which find caustics on surfaces that the camera sees
        directly. More of them (8, 32) pay where such a caustic has most of the noise. 0 leaves caustics to
        BSDF sampling. Only with "both".
    """

    strategy: str = "both"
    roulette_depth: int = 3
    survival: float = 0.99
    light_paths: float = setting(LIGHT_PATHS_PER_RAY, LIGHT_PATHS)

    def __post_init__(self) -> None:
        """Refuse what is out of range."""
        checks.choice(self.strategy, "PathOptions strategy", WAYS)
        checks.whole(self.roulette_depth, "PathOptions roulette_depth", at_least=0, up_to=DEEPEST)
        checks.number(
            self.light_paths, "PathOptions light_paths", at_least=0.0, up_to=MOST, hint="0: none"
        )
        checks.number(self.survival, "PathOptions survival", above=0.0, up_to=1.0)

    @property
    def without_light_paths(self) -> str:
        """Why these options allow no light subpaths; "": they do."""
        if self.strategy != "both":
            return f"strategy={self.strategy!r}"
        return "light_paths=0" if self.light_paths == 0.0 else ""

    @property
    def samples_lights(self) -> bool:
        """Whether next-event estimation samples lights, not BSDF sampling alone."""
        return self.strategy != "directions"

    def n_light_paths(self, n_pixels: int) -> int:
        """Return the number of light subpaths of a pass, where there are any."""
        return max(round(self.light_paths * n_pixels), 1)


PHOTONS = Flag("photons", int, "N", "photons of a pass ({})", "{} photons")
ALPHA = Flag(
    "alpha", float, "A", "how slowly discs shrink ({}; default 2/3)", "alpha {:.3g}", "{:.6g}"
)


@explains(photons="photons_per_pass", radius="initial_radius")
@dataclass(frozen=True)
class PPMOptions(Options):
    """Options of the integrator "ppm", progressive photon mapping.

    Attributes
    ----------
    photons_per_pass : int
        Number of photons that all lights together emit per pass, at least 1, shared by power. Each
        light emits at least two, one of them aimed if the projection map is not empty.
    alpha : float
        The radius reduction parameter of Hachisuka et al., above 0 and at most 1. Larger values
        shrink the discs more slowly. At 1 they do not shrink: the noise falls fastest, but the blur
        stays, and a warning is given.
    initial_radius : float, optional
        Radius of the discs in the first pass, scene units, between a millionth and a quarter of the
        diagonal of the box around all bounded surfaces. If the box around the camera and what it sees
        has less than a hundredth of that diagonal, its own counts. By default it follows the local photon density.
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
                stacklevel=4,
            )
        if self.initial_radius is not None:
            checks.number(self.initial_radius, "PPMOptions initial_radius", above=0.0)

    @property
    def n_photons(self) -> int:
        """Photons emitted per pass."""
        return self.photons_per_pass

    @property
    def error_power(self) -> float:
        """The asymptotic rate k: the squared error falls as passes ** -k.

        The variance falls as passes^-alpha and the squared blur as passes^(2 alpha - 2) (Knaus and
        Zwicker, 2011); the slower one dominates. At alpha = 1 the blur does not fall; the rate is
        that of the variance.
        """
        return float(min(self.alpha, 2.0 - 2.0 * self.alpha)) if self.alpha < 1.0 else 1.0

    @property
    def blur_stays(self) -> bool:
        """Whether the discs never shrink."""
        return self.alpha == 1.0


@explains(photons="photons_per_pass", k="nearest")
@dataclass(frozen=True)
class PhotonMapOptions(Options):
    """Options of the integrator "photon_map".

    Attributes
    ----------
    photons_per_pass : int
        Number of photons that all lights together emit per pass, at least 1. Each light emits at
        least two, as for `PPMOptions`.
    nearest : int
        Number of photons per density estimate, at least 2. More photons blur more, fewer are
        noisier.
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
        """Photons emitted per pass."""
        return self.photons_per_pass

    @property
    def blur_stays(self) -> bool:
        """True: the discs hold the same number of photons in every pass."""
        return True
