"""What `hybrid_rt.rendering.render` takes beside the scene; the command line makes its options of it."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol

from hybrid_rt.core import checks
from hybrid_rt.core.progress import Progress
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.rendering.settings import Settings, declared_in, setting
from hybrid_rt.rendering.watcher import Watcher, check_watcher
from hybrid_rt.scene.scene import Scene

if TYPE_CHECKING:
    from hybrid_rt.rendering.result import RenderResult

P = ParamSpec("P")


def other_names() -> dict[str, str]:
    """Return the names of settings by those that other programs have for them."""
    known = declared_in(Arguments).items()
    return {other: name for name, setting in known for other in setting.others.split()}


def _progress(value: Any, name: str) -> Any:
    if not callable(value):
        raise TypeError(
            f"{name} is {checks.shown(value)}: pass a function such as progress_bar(), or None"
        )
    return value


def _address(value: Any, _name: str) -> Any:
    from hybrid_rt.rendering.cluster import check_address

    return check_address(value)


@dataclass(frozen=True, kw_only=True)
class Arguments(Settings):
    """What `hybrid_rt.rendering.render` takes beside the scene, checked."""

    progress: Progress | None = setting(None, _progress)
    store: str | os.PathLike[str] | None = setting(
        None, None, "DIR",
        "keep the sums over passes there, every ten seconds: the render can go on after Ctrl-C, a crash or its end",
        Path,
    )  # fmt: skip
    resume: bool = setting(
        False, checks.flag, "",
        "go on from what --store holds, if anything; --passes counts that as well",
    )  # fmt: skip
    cluster: str | None = setting(
        None, _address, "ADDRESS",
        "let workers of dask.distributed make the passes: tcp://HOST:PORT of a scheduler, or local:N for N processes",
    )  # fmt: skip
    watch: Watcher | None = setting(None, lambda value, _: check_watcher(value))

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
