"""The settings of a picture, each declared once: default, check, flag, and whether it decides bits.

Workers of a cluster get the `Settings`, the report repeats them, and a store compares the ones that decide
the bits of a pass. What else a render takes is in `hybrid_rt.rendering.arguments`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, asdict, dataclass, field, fields
from typing import Any, NamedTuple

from hybrid_rt.core import checks
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators import DEFAULT, INTEGRATORS, OWN, Declaration, Options
from hybrid_rt.integrators.options import DEEPEST
from hybrid_rt.rendering.channels import OUTPUTS, check_names
from hybrid_rt.rendering.limits import DEFAULT_DEPTH, DEFAULT_PASSES, MOST_PASSES, Limit
from hybrid_rt.sampling.sampler import Sampler


class Setting(NamedTuple):
    """What is known of a setting beside its name, type and default; its option is empty if it has none."""

    check: Callable[[Any, str], Any] | None = (
        None  # returns a value that is not None as it is used, or raises
    )
    metavar: str = ""
    help: str = ""
    read: Callable[[str], Any] = str  # takes the text of its option; a ValueError says what to pass
    decides: bool = False  # the bits of a pass
    others: str = ""  # names that other programs have for it


def setting(default: Any, *known: Any, **more: Any) -> Any:
    """Return the field of a setting: its default, and what `Setting` holds."""
    return field(default=default, metadata={"setting": Setting(*known, **more)})


def declared_in(kind: type[Settings]) -> dict[str, Setting]:
    """Return what is known of the settings in a class, by their names."""
    return {f.name: f.metadata["setting"] for f in fields(kind)}


def read_whole(text: str) -> int:
    """Read a whole number, which may be written as 1e5."""
    with suppress(ValueError, OverflowError):
        number = float(text) if "e" in text.lower() else int(text)
        if number == int(number):
            return int(number)
    raise ValueError("pass a whole number, such as 64 or 1e5")


def _share(text: str) -> float:
    try:
        return float(text[:-1]) / 100.0 if text.endswith("%") else float(text)
    except ValueError:
        raise ValueError("pass a share, such as 0.02 or 2%") from None


def _number(of: str) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            return float(text)
        except ValueError:
            raise ValueError(f"pass {of}") from None

    return read


def _words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _whole(at_least: int, up_to: int) -> Callable[[Any, str], Any]:
    return lambda value, name: checks.whole(value, name, at_least=at_least, up_to=up_to)


def _target(value: Any, name: str) -> float:
    return checks.number(value, name, above=0.0, up_to=1.0, hint="a share: 0.05 for 5 %")


@dataclass(frozen=True)
class Settings:
    """What a picture is made by; the report has it. Attributes are those of `hybrid_rt.rendering.render`."""

    integrator: str = setting(
        DEFAULT, lambda value, name: checks.choice(value, name, INTEGRATORS), "I",
        f"{', '.join(OWN[:-1])} or {OWN[-1]} (default: what the scene names, else {DEFAULT})",
        decides=True, others="method",
    )  # fmt: skip
    passes: int | None = setting(
        None, _whole(1, MOST_PASSES), "N",
        f"samples per pixel (default {DEFAULT_PASSES}; with a time budget or target error: as many as that takes)",
        read_whole, others="spp samples samples_per_pixel iterations",
    )  # fmt: skip
    time_budget: float | None = setting(
        None, lambda value, name: checks.number(value, name, above=0.0), "S",
        "stop after S seconds of this call; on a busy machine later, by up to about a pass or group of passes",
        _number("seconds, such as 60"),
    )  # fmt: skip
    target_error: float | None = setting(
        None, _target, "E", "stop at this estimated relative error of the picture (0.01 or 1%%)",
        _share, others="error",
    )  # fmt: skip
    _: KW_ONLY
    target_error_trimmed: float | None = setting(
        None, _target, "E", "stop at this error without the worst 0.1 %% of the pixels", _share
    )
    seed: int = setting(
        0, lambda value, _: int(Sampler(value).seed), "S",
        "equal seeds give equal pictures (default 0)", read_whole, decides=True,
    )  # fmt: skip
    threads: int | None = setting(
        None, lambda value, _: Pool(value).threads, "N", "default: all cores", read_whole
    )
    max_depth: int = setting(
        DEFAULT_DEPTH, _whole(0, DEEPEST), "N", f"bounces of a path (default {DEFAULT_DEPTH})",
        read_whole, decides=True, others="depth bounces max_bounces",
    )  # fmt: skip
    accuracy: str = setting(
        "certified", None, "A", "mesh, refined or certified (default)", decides=True
    )
    coarse: str = setting(
        "embree", None, "C",
        "embree (default) or none: certified hits without triangles, the same picture bit for bit",
    )  # fmt: skip
    tolerance: float | None = setting(
        None, None, "T", "of the coarse mesh, in scene units", _number("a length, such as 0.001"),
        decides=True,
    )  # fmt: skip
    outputs: Sequence[str] = setting(
        (), lambda value, _: check_names(value), "A,B",
        f"also keep in .npz and .exr: {', '.join(OUTPUTS)}", _words,
    )  # fmt: skip
    options: Options | None = setting(None, decides=True)

    @property
    def declared(self) -> Declaration:
        """The integrator's declaration."""
        return INTEGRATORS[self.integrator]

    @property
    def own(self) -> Options:
        """The options of the integrator, given or by default."""
        return self.options or self.declared.options()

    @property
    def n_threads(self) -> int:
        """The number of threads, given or by default."""
        return Pool(self.threads).threads

    @property
    def targets(self) -> dict[str, float]:
        """The target errors that are given, by name."""
        return self.limit.targets

    @property
    def limit(self) -> Limit:
        """What ends the render."""
        return Limit(self.passes, self.time_budget, self.target_error, self.target_error_trimmed)

    @property
    def decisive(self) -> dict[str, Any]:
        """What decides the bits of a pass, by name, in plain types."""
        names = [name for name, one in declared_in(Settings).items() if one.decides]
        found = {name: getattr(self, name) for name in names}
        return {**found, "options": None if self.options is None else asdict(self.options)}
