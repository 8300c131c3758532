"""Judges surfaces of revolution: plain bisection in the oracle, Newton on (v, t) to many digits."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.verify.judges.kernels import events, patch_bisection, profile_roots
from hybrid_rt.verify.judges.surface_judge import Number, Solver, SurfaceJudge, Vector, Worker
from meshing import SurfaceOfRevolution

# Deepest stack of pieces.
DEPTH = 110


class RevolutionJudge(SurfaceJudge, of=SurfaceOfRevolution):
    """What is known of a surface of revolution: a whole turn of a profile without weights.

    Raises
    ------
    TypeError
        For others; `hybrid_rt.verify.exact` judges these.
    """

    surface: SurfaceOfRevolution

    def __init__(self, surface: SurfaceOfRevolution) -> None:
        super().__init__(surface)
        if surface.is_rational or not surface.is_whole_turn:
            raise TypeError(
                f"surface is a {surface!r}: the bisecting judge knows whole turns of profiles without "
                "weights only, ask ExactJudge"
            )

    def worker(self, object_id: int) -> Worker:
        """Return a function that bisects the profile."""
        surface = self.surface
        # A segment on the axis has no area.
        segments = [net for net in surface.segments if net[:, 1].max() > 0.0]
        ids = np.array([i for i, net in enumerate(surface.segments) if net[:, 1].max() > 0.0])
        points = np.concatenate(segments)
        z = 0.5 * (points[:, 0].min() + points[:, 0].max())
        radius = float(np.hypot(points[:, 0] - z, points[:, 1]).max())
        profile = profile_roots.Profile(
            control=points,
            starts=np.concatenate([[0], np.cumsum([len(net) for net in segments])]).astype(
                np.int64
            ),
            numbers=ids.astype(np.int32),
            frame=np.stack([surface.axis, surface.radial, surface.binormal]),
            origin=np.array(surface.origin),
            middle=surface.origin + z * surface.axis,
            radius=radius,
            size=2.0 * radius,
            object_id=object_id,
        )

        def work(
            first: int, o: FloatArray, d: FloatArray, t: FloatArray, out: events.Events
        ) -> None:
            scratch = profile_roots.ProfileScratch(
                nets=np.empty((DEPTH, 62)),
                spans=np.empty((DEPTH, 4)),
                leaves=np.empty((patch_bisection.MOST_LEAVES, 4)),
                one=np.empty((1, 4)),
                high=np.empty(31),
                low=np.empty(31),
                frame=np.empty((3, 3)),
                point=np.empty((3, 2)),
                local=np.empty((6, 2)),
                line=np.empty(6),
                out=np.empty(8),
            )
            begin = int(out.count[0])
            profile_roots.profile_events(profile, first, o, d, t, scratch, out)
            if surface.u_range[0] != 0.0:
                own = out.u[begin : int(out.count[0])]
                own[:] = (own - surface.u_range[0]) % 1.0

        return work

    def solver(self) -> Solver:
        """Return Newton's method for the height on the axis and the distance from it."""
        import mpmath

        from hybrid_rt.verify.judges.digits import ASIDE, MOST_STEPS, SMALL, curve, numbers, solved

        surface = self.surface
        origin = numbers(surface.origin)
        frame = [numbers(v) for v in (surface.axis, surface.radial, surface.binormal)]
        profiles = [[numbers(point) for point in segment] for segment in surface.segments]

        def solve(patch: int, _u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
            start = solved(frame, [a - b for a, b in zip(o, origin, strict=True)])
            way = solved(frame, d)
            assert start is not None
            assert way is not None
            x = numbers((v, t))
            for _ in range(MOST_STEPS):
                (z, r), (dz, dr) = curve(profiles[patch], x[0])
                a, b, c = (p + x[1] * q for p, q in zip(start, way, strict=True))
                # The height on the axis, and the square of the distance from it, of profile and ray.
                f, g = z - a, r * r - b * b - c * c
                f_t, g_t = -way[0], -2 * (b * way[1] + c * way[2])
                determinant = dz * g_t - f_t * 2 * r * dr
                if determinant == 0:
                    x[0] += ASIDE
                    continue
                step = [(f * g_t - f_t * g) / determinant, (dz * g - 2 * r * dr * f) / determinant]
                x = [x[0] - step[0], x[1] - step[1]]
                if abs(step[1]) <= SMALL * abs(x[1]) and abs(step[0]) <= SMALL:
                    return x[1]
            return mpmath.nan

        return solve
