"""The inputs of an integrator: scene tables, intersector, plan, sampler, ledger."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection import Intersector
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.scene.plan import Plan


@dataclass(frozen=True)
class RenderContext:
    """All inputs of an integrator."""

    scene: CompiledScene
    tracer: Intersector
    pool: Pool
    plan: Plan
    sampler: Sampler
    ledger: Ledger
    max_depth: int
    options: Any = None
    """Settings of the integrator, or None for those it has by itself."""

    def with_own_counts(self, **changes: Any) -> RenderContext:
        """Return the same inputs but for some changes, with counts of their own."""
        tracer, ledger = self.tracer.with_own_counters(), Ledger(self.ledger.now)
        return replace(self, tracer=tracer, ledger=ledger, **changes)
