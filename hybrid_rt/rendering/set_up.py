"""From a scene to what makes its passes: tables, intersector, plan, workers."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.precompile import want
from hybrid_rt.core.progress import Progress
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators import INTEGRATORS, Declaration, Options
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.workers import Workers
from hybrid_rt.intersection import Intersector
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.compiled import CompiledScene, compile_scene
from hybrid_rt.scene.lint.faults import faults_of
from hybrid_rt.scene.lint.lamps_in_surfaces import with_lamps_lifted
from hybrid_rt.scene.plan import KERNELS_FOR, Plan, make_plan
from hybrid_rt.scene.scene import Scene


@dataclass(frozen=True)
class Request:
    """What decides the bits of a pass, and by which way its hits are found.

    Attributes are those of `hybrid_rt.rendering.render`, checked.
    """

    scene: Scene
    integrator: str
    seed: int
    max_depth: int
    accuracy: str
    coarse: str
    tolerance: float | None
    options: Options

    @property
    def declared(self) -> Declaration:
        """The integrator's declaration."""
        return INTEGRATORS[self.integrator]


@dataclass(frozen=True)
class Ready:
    """What makes passes.

    Attributes
    ----------
    context : RenderContext
        Its plan also has what pilot passes decided.
    plan : Plan
        As the scene alone decides it: what further workers begin with.
    workers : Workers
    left_out : list of str
        Which light the integrator does not find; see `Declaration.left_out_light`.
    sunken : list of dict
        Lamps that lie in surfaces, for the report.
    faults : dict
        What else is wrong with the scene, for the report; see `faults_of`.
    """

    context: RenderContext
    plan: Plan
    workers: Workers
    left_out: list[str]
    sunken: Any
    faults: dict[str, Any]


def set_up(
    request: Request, threads: int, ledger: Ledger, progress: Progress | None = None
) -> Ready:
    """Make all that passes need.

    Parameters
    ----------
    request : Request
    threads : int
    ledger : Ledger
        Gets the seconds of each stage.
    progress : Progress, optional
    """
    declared, own = request.declared, request.options
    with ledger.stage("scene"):
        compiled = compile_scene(request.scene)
        left_out = declared.left_out_light(compiled, own)
        plan = make_plan(compiled, declared.with_options(own), left_out)
        unneeded = [kernels for kernels, purpose in KERNELS_FOR.items() if not plan[purpose]]
        want(request.integrator, but=unneeded)
    with ledger.stage("build"):
        if progress is not None:
            progress("Building", 0, 0)

        def build(flat: CompiledScene) -> Intersector:
            ways = request.accuracy, request.coarse, request.tolerance
            began = ledger.now()
            built = Intersector(flat.surfaces, *ways, threads=1)
            # The render's clock stands still while kernels are compiled, the tracer's own does not.
            built.coarse_build_seconds = min(built.coarse_build_seconds, ledger.now() - began)
            built.now = ledger.now
            return built

        compiled, tracer, sunken = with_lamps_lifted(request.scene, compiled, build)
        faults = faults_of(compiled, tracer)
    # Threads share blocks of camera rays; within a block everything runs in one.
    sampler = Sampler(request.seed)
    context = RenderContext(
        compiled, tracer, Pool(1), plan, sampler, ledger, request.max_depth, own
    )
    of_scene = deepcopy(plan)
    with ledger.stage("set-up"):
        workers = declared.make(context, threads)
        workers.forget_seconds()
    return Ready(context, of_scene, workers, left_out, sunken, faults)
