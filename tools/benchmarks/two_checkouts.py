"""Two checkouts side by side: squared error times processor seconds of the same renders.

Machines are noisy and errors of pictures depend on the seed. So one child process for each checkout
renders the same scene in turn, with equal seeds, and what counts is the ratio within each round.
Whoever renders first alternates.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import renders_on_request
from hybrid_rt.sensor.image_metrics import WORST, noise_of_reference, relative_mse

HERE = Path(__file__).resolve().parents[2]
REFERENCE_SEED = 20_000
# Measured of each render, and what the ratios are of.
MEASURES = ("relmse", "trimmed", "wall", "processor", "work", "trimmed_work")


@dataclass(frozen=True)
class Job:
    """What is rendered.

    Attributes
    ----------
    scene : Path
        A scene script that both checkouts understand.
    integrator : str
    passes : int
        Of each render.
    rounds : int
        Renders by each checkout, each round with a seed of its own.
    reference_passes : int
        Of the reference, which this checkout renders with other random numbers.
    width : int, optional
        Pixels; proportions are kept. None: as the scene says.
    photons : int, optional
        Of a pass ("ppm", "photon_map").
    threads : int, optional
    coarse : str
        Checkouts that have no such setting render by Embree.
    """

    scene: Path
    integrator: str
    passes: int
    rounds: int
    reference_passes: int
    width: int | None = None
    photons: int | None = None
    threads: int | None = None
    coarse: str = "embree"


class _Child:
    """A process that renders by one checkout."""

    def __init__(self, checkout: Path, job: Job, folder: Path) -> None:
        self.checkout = checkout
        self._file = folder / f"{'new' if checkout == HERE else 'old'}.npz"
        environment = {**os.environ, "PYTHONPATH": str(checkout)}
        self._process = subprocess.Popen(
            [sys.executable, renders_on_request.__file__],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, cwd=folder,
        )  # fmt: skip
        asked = asdict(job) | {"scene": str(job.scene.resolve())}
        told = self._ask(asked)
        self.size: tuple[int, int] = tuple(told["size"])
        home = Path(told["home"]).resolve()
        if home.parents[1] != checkout:
            self.end()
            raise ValueError(f"{checkout} was asked to render, but {home} was imported instead")

    def render(
        self, passes: int, seed: int, outputs: tuple[str, ...] = ()
    ) -> tuple[dict[str, float], dict[str, NDArray[Any]]]:
        """Render; return seconds, and the image and outputs by name."""
        seconds = self._ask(
            {"passes": passes, "seed": seed, "file": str(self._file), "outputs": outputs}
        )
        with np.load(self._file) as arrays:
            return seconds, dict(arrays)

    def _ask(self, question: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(question) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # it has ended, and so does its answer
        line = self._process.stdout.readline()
        answer: dict[str, Any] = (
            json.loads(line) if line else {"error": "the process ended without an answer"}
        )
        if "error" in answer:
            self.end()
            raise ValueError(f"checkout {self.checkout}: {answer['error']}")
        return answer

    def end(self) -> None:
        self._process.terminate()
        self._process.communicate()


def checkout_at(folder: Path) -> Path:
    """Return the absolute path of a checkout.

    Raises
    ------
    ValueError
        If the folder holds no checkout of this project.
    """
    for package in ("hybrid_rt", "meshing"):
        if not (folder / package / "__init__.py").is_file():
            raise ValueError(
                f"{str(folder)!r} is no checkout: it has no {package}/__init__.py; make one by "
                "git worktree add DIR COMMIT, and name DIR"
            )
    return folder.resolve()


def compare(checkout: Path, job: Job) -> dict[str, Any]:
    """Render a job by another checkout and by this one, in turn.

    Parameters
    ----------
    checkout : Path
        The other, older one; see `checkout_at`.
    job : Job

    Returns
    -------
    dict, in plain types
        ``old`` and ``new`` hold a list for each of `MEASURES`, a value a round: relMSE, the same
        without the worst 0.1 % of the values, wall and processor seconds of `render`, scene set-up
        included, and the products of either error and processor seconds. ``ratios`` are those of
        old over new: geometric mean, least and most. ``relmse_of_reference`` is the reference's own
        error, which is part of both and so draws ratios toward one.

    Raises
    ------
    ValueError
        If a checkout cannot render the job; the message names it.
    """
    with TemporaryDirectory() as folder, _children(checkout, job, Path(folder)) as (old, new):
        for child in (old, new):
            child.render(1, 0)  # compiles
        _, reference = new.render(job.reference_passes, REFERENCE_SEED, ("standard_error",))
        measured: dict[str, dict[str, list[float]]] = {
            side: {measure: [] for measure in MEASURES} for side in ("old", "new")
        }
        for k in range(job.rounds):
            both = [("old", old), ("new", new)]
            for side, child in both if k % 2 == 0 else both[::-1]:
                seconds, picture = child.render(job.passes, 1 + k)
                values = _measured(picture["image"], reference["image"], seconds)
                for measure in MEASURES:
                    measured[side][measure].append(values[measure])
        return {
            "scene": job.scene.stem,
            "size": list(new.size),
            **{key: value for key, value in asdict(job).items() if key not in ("scene", "width")},
            "old_checkout": named(checkout),
            "new_checkout": named(HERE),
            "relmse_of_reference": noise_of_reference(
                reference["image"], reference["standard_error"]
            ),
            **measured,
            "ratios": {
                measure: _ratio(measured["old"][measure], measured["new"][measure])
                for measure in MEASURES
            },
        }


def named(checkout: Path) -> str:
    """Return the commit of a checkout, with a + if files differ from it; else its path."""
    git = ["git", "-C", str(checkout)]
    try:
        commit = subprocess.run(
            [*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
        ).stdout.strip()
        changes = subprocess.run(
            [*git, "status", "--porcelain", "--untracked-files=no"],
            capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return str(checkout)
    return commit + ("+" if changes else "")


def _measured(
    image: NDArray[np.floating], reference: NDArray[np.floating], seconds: dict[str, float]
) -> dict[str, float]:
    error = relative_mse(image, reference)
    trimmed = relative_mse(image, reference, leave_out=WORST)
    return {
        "relmse": error,
        "trimmed": trimmed,
        **seconds,
        "work": error * seconds["processor"],
        "trimmed_work": trimmed * seconds["processor"],
    }


def _ratio(old: list[float], new: list[float]) -> dict[str, float]:
    """Return geometric mean, least and most of the ratios of two lists; nan where one is zero."""
    ratios = [a / b if a > 0.0 and b > 0.0 else math.nan for a, b in zip(old, new, strict=True)]
    mean = math.exp(sum(math.log(ratio) for ratio in ratios) / len(ratios))
    return {"mean": mean, "least": min(ratios), "most": max(ratios)}


@contextmanager
def _children(checkout: Path, job: Job, folder: Path) -> Iterator[tuple[_Child, _Child]]:
    """Run a process for either checkout, the other one first."""
    begun: list[_Child] = []
    try:
        for place in (checkout, HERE):
            begun.append(_Child(place, job, folder))
        yield begun[0], begun[1]
    finally:
        for child in begun:
            child.end()
