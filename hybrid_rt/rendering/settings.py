"""The settings of a render, each declared once: default, check, flag, and whether it decides bits.

`Arguments` are what `hybrid_rt.rendering.render` takes beside the scene. The command line makes its options
of them; workers of a cluster get the `Settings` among them, the report repeats those, and a store compares
the ones that decide the bits of a pass.
"""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, Protocol

from hybrid_rt.core import checks
from hybrid_rt.core.progress import Progress
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators import DEFAULT, INTEGRATORS, OWN, Declaration, Options
from hybrid_rt.integrators.options import DEEPEST
from hybrid_rt.rendering.channels import OUTPUTS, check_names
from hybrid_rt.rendering.limits import DEFAULT_DEPTH, DEFAULT_PASSES, MOST_PASSES, Limit
from hybrid_rt.rendering.watcher import Watcher, check_watcher
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.scene import Scene

if TYPE_CHECKING:
    from hybrid_rt.rendering.result import RenderResult

P = ParamSpec("P")


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


def _setting(default: Any, *known: Any, **more: Any) -> Any:
    return field(default=default, metadata={"setting": Setting(*known, **more)})


def declared_in(kind: type[Settings]) -> dict[str, Setting]:
    """Return what is known of the settings in a class, by their names."""
    return {f.name: f.metadata["setting"] for f in fields(kind)}


def other_names() -> dict[str, str]:
    """Return the names of settings by those that other programs have for them."""
    known = declared_in(Arguments).items()
    return {other: name for name, setting in known for other in setting.others.split()}


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


def _progress(value: Any, name: str) -> Any:
    if not callable(value):
        raise TypeError(
            f"{name} is {checks.shown(value)}: pass a function such as progress_bar(), or None"
        )
    return value


def _address(value: Any, _name: str) -> Any:
    from hybrid_rt.rendering.cluster import check_address

    return check_address(value)


@dataclass(frozen=True)
class Settings:
    """What a picture is made by; the report has it. Attributes are those of `hybrid_rt.rendering.render`."""

    integrator: str = _setting(
        DEFAULT, lambda value, name: checks.choice(value, name, INTEGRATORS), "I",
        f"{', '.join(OWN[:-1])} or {OWN[-1]} (default: what the scene names, else {DEFAULT})",
        decides=True, others="method",
    )  # fmt: skip
    passes: int | None = _setting(
        None, _whole(1, MOST_PASSES), "N",
        f"samples per pixel (default {DEFAULT_PASSES}; with a time budget or target error: as many as that takes)",
        read_whole, others="spp samples samples_per_pixel iterations",
    )  # fmt: skip
    time_budget: float | None = _setting(
        None, lambda value, name: checks.number(value, name, above=0.0), "S",
        "stop after S seconds of this call; on a busy machine later, by up to about a pass or group of passes",
        _number("seconds, such as 60"),
    )  # fmt: skip
    target_error: float | None = _setting(
        None, _target, "E", "stop at this estimated relative error of the picture (0.01 or 1%%)",
        _share, others="error",
    )  # fmt: skip
    _: KW_ONLY
    target_error_trimmed: float | None = _setting(
        None, _target, "E", "stop at this error without the worst 0.1 %% of the pixels", _share
    )
    seed: int = _setting(
        0, lambda value, _: int(Sampler(value).seed), "S",
        "equal seeds give equal pictures (default 0)", read_whole, decides=True,
    )  # fmt: skip
    threads: int | None = _setting(
        None, lambda value, _: Pool(value).threads, "N", "default: all cores", read_whole
    )
    max_depth: int = _setting(
        DEFAULT_DEPTH, _whole(0, DEEPEST), "N", f"bounces of a path (default {DEFAULT_DEPTH})",
        read_whole, decides=True, others="depth bounces max_bounces",
    )  # fmt: skip
    accuracy: str = _setting(
        "certified", None, "A", "mesh, refined or certified (default)", decides=True
    )
    coarse: str = _setting(
        "embree", None, "C",
        "embree (default) or none: certified hits without triangles, the same picture bit for bit",
    )  # fmt: skip
    tolerance: float | None = _setting(
        None, None, "T", "of the coarse mesh, in scene units", _number("a length, such as 0.001"),
        decides=True,
    )  # fmt: skip
    outputs: Sequence[str] = _setting(
        (), lambda value, _: check_names(value), "A,B",
        f"also keep in .npz and .exr: {', '.join(OUTPUTS)}", _words,
    )  # fmt: skip
    options: Options | None = _setting(None, decides=True)

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


@dataclass(frozen=True, kw_only=True)
class Arguments(Settings):
    """What `hybrid_rt.rendering.render` takes beside the scene, checked."""

    progress: Progress | None = _setting(None, _progress)
    store: str | os.PathLike[str] | None = _setting(
        None, None, "DIR",
        "keep the sums over passes there, every ten seconds: the render can go on after Ctrl-C, a crash or its end",
        Path,
    )  # fmt: skip
    resume: bool = _setting(
        False, checks.flag, "",
        "go on from what --store holds, if anything; --passes counts that as well",
    )  # fmt: skip
    cluster: str | None = _setting(
        None, _address, "ADDRESS",
        "let workers of dask.distributed make the passes: tcp://HOST:PORT of a scheduler, or local:N for N processes",
    )  # fmt: skip
    watch: Watcher | None = _setting(None, lambda value, _: check_watcher(value))

    def __post_init__(self) -> None:
        """Refuse what is unknown or out of range."""
        for name, value in checked(vars(self)).items():
            object.__setattr__(self, name, value)

    @property
    def settings(self) -> Settings:
        """Those that are about the picture."""
        return Settings(**{f.name: getattr(self, f.name) for f in fields(Settings)})


def checked(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return values of settings by name, some or all of `Arguments`, as they are used; raise for wrong ones."""
    from hybrid_rt.intersection.intersector import check_settings

    known, values = declared_in(Arguments), dict(given)
    every: dict[str, Any] = {one.name: one.default for one in fields(Arguments)}
    for name, value in given.items():
        check = known[name].check
        if check is not None and not (value is None and every[name] is None):
            values[name] = check(value, name)
    every |= values
    check_settings(every["accuracy"], every["coarse"], every["tolerance"])
    options, declared = every["options"], INTEGRATORS[every["integrator"]]
    has_some = bool(fields(declared.options))
    if options is not None and not (has_some and isinstance(options, declared.options)):
        wanted = declared.options.__name__ if has_some else "no options"
        raise TypeError(
            f"options are {checks.shown(options)}: integrator {declared.name!r} takes {wanted}"
        )
    if every["store"] is not None:
        from hybrid_rt.rendering.store import check_folder

        check_folder(every["store"], every["resume"])
    elif every["resume"]:
        raise ValueError("resume is True, but there is no store: pass its folder as store")
    return values


class _Renders(Protocol[P]):
    """A function of a scene and settings."""

    def __call__(self, scene: Scene, *args: P.args, **settings: P.kwargs) -> RenderResult: ...


def takes(
    arguments: Callable[P, Arguments],
) -> Callable[[Callable[[Scene, Arguments], RenderResult]], _Renders[P]]:
    """Return a decorator: a function of a scene and `Arguments` takes them one by one."""

    def decorate(render: Callable[[Scene, Arguments], RenderResult]) -> _Renders[P]:
        @functools.wraps(render)
        def call(scene: Scene, *args: P.args, **settings: P.kwargs) -> RenderResult:
            if not isinstance(scene, Scene):
                raise TypeError(f"render scene is {checks.shown(scene)}: pass a Scene")
            return render(scene, arguments(*args, **settings))

        own, others = inspect.signature(render), inspect.signature(arguments).parameters.values()
        first = next(iter(own.parameters.values()))
        # What help and documentation show.
        call.__signature__ = own.replace(parameters=[first, *others])  # type: ignore[attr-defined]
        return call

    return decorate
