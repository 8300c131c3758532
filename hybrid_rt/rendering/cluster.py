"""Passes by many processes or machines, scheduled by dask.distributed (extra ``cluster``).

A pass is a pure function of its number, so workers need the scene once and a range of numbers per
task; whichever worker makes it, at whatever try, it has the same bits. Results are added in the
order of their numbers, so nothing is added twice. A whole run of passes comes back as one sum.
"""

from __future__ import annotations

import importlib.util
import pickle
import time
import uuid
from collections import deque
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from hybrid_rt.core import checks
from hybrid_rt.core.interrupts import heard_anywhere, unheard_by_others
from hybrid_rt.integrators.workers import Made, Pass, Workers
from hybrid_rt.rendering.identity import unequal
from hybrid_rt.rendering.report import ClusterFigures
from hybrid_rt.rendering.run import ClusterLost
from hybrid_rt.rendering.settings import Settings
from hybrid_rt.rendering.versions import versions
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.passes import RUN

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

    from hybrid_rt.rendering.cluster_tasks import Part, TaskResult

LOCAL = "local:"
# Tasks that each thread of the cluster has at hand, so that none waits for the network.
AT_HAND = 2
# A task is to take about so many seconds: much longer than the scheduler's milliseconds, and short
# enough that little is lost with a worker. It has a run of passes at least.
SECONDS, MOST_RUNS = 2.0, 16
# Seconds to wait for a first worker; between looks at who is there; for the scheduler's answer.
PATIENCE, LOOK, ANSWER = 60.0, 1.0, 10.0
# What to do about a scene that is made of parts of a script.
_IMPORTABLE = "put the classes and functions that it uses into a module that workers can import"
# What to do about an integrator of the caller's own.
_OWN_THERE = "declare it in a module and start them by `dask worker --preload MODULE`"
_OWN_LOCALLY = (
    "run `python SCRIPT --cluster {}`, as they import a script that python runs, not one that `hybrid-rt render` "
    'reads; SCRIPT declares it and ends in `if __name__ == "__main__": sys.exit(render_script(scene, __file__))`'
)
# So often is a task tried again after the end of its worker.
TRIES = 5


def check_address(address: str) -> str:
    """Return an address; raise unless it is "tcp://HOST:PORT" (or by another protocol of dask's) or "local:N"."""
    if not isinstance(address, str):
        raise TypeError(f"cluster is {checks.shown(address)}: pass 'tcp://HOST:PORT' or 'local:N'")
    number = address.removeprefix(LOCAL)
    is_local = address.startswith(LOCAL) and number.isdecimal() and 0 < int(number) <= 1024
    is_remote = "://" in address and address.rpartition(":")[2].isdecimal()
    if not (is_local or is_remote):
        raise ValueError(f"cluster is {address!r}: pass 'tcp://HOST:PORT' or 'local:N'")
    if importlib.util.find_spec("distributed") is None:
        raise ModuleNotFoundError(
            f"cluster {address!r} needs dask.distributed: pip install 'hybrid-rt[cluster]'"
        )
    return address


@dataclass
class _Task:
    first: int
    stop: int
    future: Future
    allowed: frozenset[str]
    tries: int = 1


class Cluster:
    """Makes passes in other processes; sums and counts stay with the workers of this one.

    Raises ClusterLost if there is no scheduler, or no worker of these versions within `PATIENCE` seconds,
    and ValueError if the scene cannot be sent to other processes.
    """

    def __init__(self, address: str, scene: Scene, settings: Settings, here: Workers) -> None:
        # Passes beyond the last one are not asked for.
        self._here, self._address, self._last = here, address, settings.limit.passes
        self._key = f"hybrid-rt-{uuid.uuid4().hex[:12]}"
        self._camera, self._integrator = scene.camera, settings.integrator
        try:
            self._pickled = pickle.dumps((scene, settings))
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise ValueError(
                f"cluster {address!r}: the scene cannot be sent to other processes "
                f"({_words(error)}): {_IMPORTABLE}"
            ) from error
        # What the report tells.
        self._made_by: set[str] = set()
        self._refused: dict[str, str] = {}
        self._n_tasks = self._n_again = self._received = 0
        self._seconds = 0.0
        self._counts = here.counts()
        self._has_blur: bool | None = None
        # Of workers that are ready; and those that set the scene up.
        self._threads: dict[str, int] = {}
        self._setting_up: dict[str, Future] = {}
        self._why_not_set_up = ""
        self._tasks: deque[_Task] = deque()
        self._parts: deque[Part] = deque()
        self._asked = self._yielded = -1
        self._runs = 1
        self._looked = 0.0
        self._client: Client
        self._local: LocalCluster | None = None

    def __enter__(self) -> Self:
        """Connect, bring the scene to the workers, and wait until one of them has set it up."""
        try:
            with heard_anywhere():
                self._connect()
                self._wait("no worker of these versions came")
                while self._local is not None and self._setting_up:  # they all began together
                    time.sleep(LOOK / 10)
                    self._look()
        except BaseException:
            self.__exit__()
            raise
        return self

    def _connect(self) -> None:
        import dask
        from distributed import Client, LocalCluster

        is_local = self._address.startswith(LOCAL)
        try:
            if is_local:
                n = int(self._address.removeprefix(LOCAL))
                # dask has its processes give back memory at once, which costs a quarter of the time.
                given_back = dask.config.set({"distributed.nanny.pre-spawn-environ": {}})
                with given_back, unheard_by_others():
                    self._local = LocalCluster(
                        n_workers=n, threads_per_worker=1, dashboard_address=None, silence_logs=50
                    )
            place = self._local if is_local else self._address
            self._client = Client(place, timeout=ANSWER, set_as_default=False)
        except (OSError, TimeoutError, ValueError, RuntimeError) as error:
            why = (
                f"its processes did not start ({_words(error)}): a script must render under "
                '`if __name__ == "__main__":`, since each process imports it'
                if is_local
                else f"no scheduler answers ({_words(error)}): start `dask scheduler` there"
            )
            raise self._lost(why) from error

    def __exit__(self, *_error: object) -> None:
        """Drop what is still to be made, and let go of the cluster."""
        from hybrid_rt.rendering.cluster_tasks import forget_scene

        with suppress(Exception):
            made = [task.future for task in self._tasks]
            self._client.cancel([*made, *self._setting_up.values()], force=True)
        with suppress(Exception):
            if self._local is None and self._client.status == "running":
                there = self._client.scheduler_info(n_workers=-1)["workers"]
                given = [who for who in (*self._threads, *self._setting_up) if who in there]
                self._client.run(forget_scene, self._key, workers=given, on_error="ignore")
        with suppress(Exception):
            self._client.close(timeout=2)
        with suppress(Exception):
            if self._local is not None:
                self._local.close(timeout=5)

    def at_once(self) -> int:
        """Return how many passes to ask for at a time: what the cluster has at hand."""
        return RUN * self._runs * AT_HAND * max(sum(self._threads.values()), 1)

    def render_passes(
        self, passes: range, on_rays: Callable[[int], None] | None = None
    ) -> Generator[Made, None, None]:
        """Yield at least the passes asked for, in their order; a run may end beyond them."""
        if self._yielded != passes.start:
            self._asked = self._yielded = passes.start
        n_pixels = self._camera.width * self._camera.height

        def hear() -> None:
            if on_rays is not None:
                on_rays((self._yielded - passes.start) * n_pixels)

        while self._yielded < passes.stop:
            if not self._parts:
                self._ask()
                self._parts.extend(self._next(hear))
            part = self._parts.popleft()
            self._yielded += 1 if isinstance(part.made, Pass) else RUN
            self._here.carry(part.counts)
            yield part.made
            hear()

    def _ask(self) -> None:
        """Keep as many tasks at work as the cluster's threads can take."""
        n_tasks = AT_HAND * max(sum(self._threads.values()), 1)
        while len(self._tasks) < n_tasks and (self._last is None or self._asked < self._last):
            stop = (self._asked // RUN + self._runs) * RUN
            stop = stop if self._last is None else min(stop, self._last)
            self._tasks.append(self._submitted(self._asked, stop))
            self._asked = stop

    def _submitted(self, first: int, stop: int, tries: int = 1) -> _Task:
        from hybrid_rt.rendering.cluster_tasks import make_passes

        self._n_tasks += 1
        allowed = frozenset(self._threads)
        future = self._client.submit(
            make_passes,
            self._key,
            first,
            stop,
            key=f"{self._key}-{first}-{stop}-{tries}",
            workers=sorted(allowed),
            priority=-first,
            pure=False,
        )
        return _Task(first, stop, future, allowed, tries)

    def _next(self, hear: Callable[[], None]) -> list[Part]:
        """Wait for the first of the tasks, and return what it made; call ``hear`` while nothing comes."""
        from distributed import CancelledError, KilledWorker
        from distributed.comm import CommClosedError

        while True:
            task = self._tasks[0]
            try:
                result: TaskResult = task.future.result(timeout=LOOK)
            except TimeoutError:
                self._wait("no worker is left, and none came", hear)
                hear()
                continue
            except (CancelledError, CommClosedError, KilledWorker, OSError) as error:
                self._try_again(task, error, hear)
                continue
            except KeyError as error:
                if self._key not in str(error):
                    raise self._failed(task, error) from error
                self._threads.clear()  # one was restarted, and gets the scene again
                self._try_again(task, error, hear)
                continue
            except Exception as error:
                raise self._failed(task, error) from error
            self._tasks.popleft()
            task.future.release()
            self._check(task, result)
            self._note(task, result)
            if time.monotonic() - self._looked > LOOK:
                self._look()
            return result.parts

    def _check(self, task: _Task, result: TaskResult) -> None:
        """Take nothing that cannot be what was asked for: it would be in the picture for good."""
        from hybrid_rt.rendering.cluster_tasks import check_result

        camera, passes = self._camera, range(task.first, task.stop)
        size = camera.height, camera.width
        try:
            check_result(result, passes, size, self._counts, self._has_blur)
        except ValueError as error:  # arrays of rows of unequal length raise one as well
            raise self._lost(
                f"a worker's result of passes {task.first} to {task.stop - 1} is refused: {error}. "
                "Render without cluster=, or by other workers"
            ) from error
        self._has_blur = result.parts[0].made.blur_change is not None

    def _note(self, task: _Task, result: TaskResult) -> None:
        self._seconds += result.seconds
        for made in (part.made for part in result.parts):
            arrays = (made.radiance if isinstance(made, Pass) else made.total, made.blur_change)
            self._received += sum(array.nbytes for array in arrays if array is not None)
        a_run = RUN * result.seconds / (task.stop - task.first)
        self._runs = min(max(int(SECONDS / max(a_run, 1e-9)), 1), MOST_RUNS)

    def _try_again(self, task: _Task, error: BaseException, hear: Callable[[], None]) -> None:
        if self._client.status != "running":
            raise self._lost("the scheduler is gone: start it again")
        if task.tries >= TRIES:
            raise self._failed(task, error)
        self._wait("no worker is left, and none came", hear)
        self._submit_again(task)

    def _submit_again(self, task: _Task) -> None:
        self._n_again += 1
        place = self._tasks.index(task)
        self._tasks[place] = self._submitted(task.first, task.stop, task.tries + 1)

    def _wait(self, why: str, hear: Callable[[], None] | None = None) -> None:
        """Look until a worker is ready; give up if ``why`` holds for `PATIENCE` seconds."""
        until = time.monotonic() + PATIENCE
        while not self._look():
            if self._setting_up:
                until = time.monotonic() + PATIENCE
            elif self._why_not_set_up:
                raise self._lost(f"no worker can set the scene up ({self._why_not_set_up})")
            elif time.monotonic() > until:
                refused = "; ".join(f"{who}: {why}" for who, why in self._refused.items())
                raise self._lost(
                    f"{why} within {PATIENCE:.0f} s{f' (refused: {refused})' if refused else ''}: "
                    "start `dask worker` there"
                )
            if hear is not None:
                hear()
            time.sleep(LOOK / 10)

    def _look(self) -> bool:
        """See which workers are there, and bring them the scene; tell whether any is ready.

        Those of other versions are refused. Tasks whose workers are all gone are given to those
        that are ready now.
        """
        self._looked = time.monotonic()
        if self._client.status != "running":
            raise self._lost("the scheduler is gone: start it again")
        try:
            there = self._client.scheduler_info(n_workers=-1)["workers"]
            known = (self._threads, self._setting_up, self._refused)
            self._bring_scene([who for who in there if not any(who in one for one in known)])
        except (OSError, TimeoutError, RuntimeError, KeyError):
            return bool(self._threads)  # between two states: look again later
        self._threads = {who: n for who, n in self._threads.items() if who in there}
        for who, future in list(self._setting_up.items()):
            if who in there and not future.done():
                continue
            del self._setting_up[who]
            if who not in there:
                future.cancel(force=True)
            elif future.status == "finished":
                self._threads[who] = there[who]["nthreads"]
                self._made_by.add(who)
            elif future.status == "error" and self._key not in str(error := future.exception()):
                self._refused[who] = self._why_not_set_up = self._why_not(error)
        for task in list(self._tasks):
            if self._threads and not task.allowed & self._threads.keys() and not task.future.done():
                task.future.cancel(force=True)
                self._submit_again(task)
        return bool(self._threads)

    def _bring_scene(self, new: list[str]) -> None:
        """Refuse workers of other versions; let the others set the scene up."""
        from hybrid_rt.rendering.cluster_tasks import keep_scene, set_up_scene

        if not new:
            return
        fit, own = [], versions()
        for who, found in self._client.run(versions, workers=new, on_error="return").items():
            if not isinstance(found, dict):  # an error, say
                self._refused[who] = _words(found)
            elif names := unequal(own, found):
                self._refused[who] = ", ".join(
                    f"{name} {found.get(name)} there, {own.get(name)} here" for name in names
                )
            else:
                fit.append(who)
        if not fit:
            return
        packed = self._key, self._integrator, self._pickled
        for who, error in self._client.run(
            keep_scene, *packed, workers=fit, on_error="return"
        ).items():
            if error is None:
                self._setting_up[who] = self._client.submit(
                    set_up_scene,
                    self._key,
                    key=f"{self._key}-{uuid.uuid4().hex[:12]}",
                    workers=[who],
                    priority=1,
                    pure=False,
                )

    def _lost(self, why: str) -> ClusterLost:
        return ClusterLost(f"cluster {self._address!r}: {why}")

    def _why_not(self, error: BaseException) -> str:
        """Return why a worker cannot set the scene up, and what to do."""
        from hybrid_rt.rendering.cluster_tasks import UnknownIntegratorError

        remedy = ""
        if isinstance(error, UnknownIntegratorError):
            how = _OWN_THERE if self._local is None else _OWN_LOCALLY.format(self._address)
            remedy = f": {how}, or leave out cluster="
        elif isinstance(error, ImportError | AttributeError):
            remedy = f": {_IMPORTABLE}"
        return f"{_words(error)}{remedy}"

    def _failed(self, task: _Task, error: BaseException) -> ClusterLost:
        return self._lost(
            f"passes {task.first} to {task.stop - 1} failed {task.tries} times ({_words(error)})"
        )

    def about(self, lost: str) -> ClusterFigures:
        """Return the report's entry; ``lost``: why the cluster was lost, or ""."""
        return ClusterFigures(
            address=self._address,
            workers=len(self._made_by),
            threads=sum(self._threads.values()),
            refused=self._refused,
            tasks=self._n_tasks,
            tried_again=self._n_again,
            seconds_of_tasks=round(self._seconds, 4),
            mib_received=round(self._received / 2**20, 2),
            lost=lost,
        )


def _words(error: object) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
