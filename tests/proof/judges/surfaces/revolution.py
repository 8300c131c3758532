"""Judges surfaces of revolution: plain bisection in the oracle, Newton on (v, t) to many digits."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from meshing import SurfaceOfRevolution
from proof.judges.kernels import events, patch_bisection, profile_roots
from proof.judges.surface_judge import Number, Solver, SurfaceJudge, Vector, Worker
from proof.judges.surfaces.bezier import weighted_points

# Deepest stack of pieces.
DEPTH = 110


# Where a root is uncertain anyway, an end of a part turn must not be within so many bands of it.
ROOMY = 4.0


class RevolutionJudge(SurfaceJudge, of=SurfaceOfRevolution):
    """What is known of a surface of revolution."""

    surface: SurfaceOfRevolution

    def worker(self, object_id: int) -> Worker:
        """Return a function that bisects the profile."""
        surface = self.surface
        # A segment on the axis has no area.
        segments = [net for net in surface.segments if net[:, 1].max() > 0.0]
        ids = np.array([i for i, net in enumerate(surface.segments) if net[:, 1].max() > 0.0])
        control = np.concatenate(segments)
        weight = self._weight(ids) if surface.is_rational else None
        points, rest = weighted_points(control, weight)
        z = 0.5 * (control[:, 0].min() + control[:, 0].max())
        radius = float(np.hypot(control[:, 0] - z, control[:, 1]).max())
        profile = profile_roots.Profile(
            control=control,
            weight=np.ones(len(control)) if weight is None else weight,
            points=points,
            rest=rest,
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
                nets=np.empty((DEPTH, 93)),
                plain=np.empty(0 if weight is None else 62),
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
            if out.count[0] <= out.t.size:  # else all is done again, with more room
                self._keep_part(begin, first, o, d, out)

        return work

    def _weight(self, ids: IntArray) -> FloatArray:
        """Return the weights of the control points of some segments, (total,)."""
        return np.concatenate(
            [
                np.ones(len(self.surface.segments[i])) if w is None else w
                for i in ids
                for w in (self.surface.weights[i],)
            ]
        )

    def _keep_part(
        self, begin: int, first: int, o: FloatArray, d: FloatArray, out: events.Events
    ) -> None:
        """Keep, of the events from ``begin`` on, those within the part of a turn; u runs along it.

        Those near an end become doubtful: within the band, or as far as the band moves them where
        they are uncertain anyway.
        """
        surface, stop = self.surface, int(out.count[0])
        own = events.Events(out.count, *(column[begin:stop] for column in out[1:]))
        turn = (own.u - surface.u_range[0]) % 1.0
        if surface.is_whole_turn:
            own.u[:] = turn
            return
        part = surface.u_range[1] - surface.u_range[0]
        rows = own.ray - first
        along = o[rows] + own.t[:, None] * d[rows] - surface.origin
        rho = np.linalg.norm(np.cross(along, surface.axis), axis=1)
        to_end = np.minimum(np.minimum(turn, 1.0 - turn), np.abs(turn - part))
        to_end = rho * np.sin(2.0 * np.pi * np.minimum(to_end, 0.25))
        cosine = np.maximum(own.cosine, events.LEAST_COSINE)
        is_plain = (own.kind == events.ROOT) & (own.at_edge == 0)
        is_near = to_end * cosine <= np.where(is_plain, events.SHIFT, ROOMY) * own.band
        given_up = own.kind == events.UNDECIDED
        own.kind[is_near & ~given_up] = events.DOUBTFUL
        own.u[:] = np.where(turn > 0.5 * (1.0 + part), 0.0, np.minimum(turn / part, 1.0))
        kept = np.flatnonzero((turn <= part) | is_near | given_up)
        out.count[0] = begin + kept.size
        for column in own[1:]:
            column[: kept.size] = column[kept]

    def solver(self) -> Solver:
        """Return Newton's method for the height on the axis and the distance from it."""
        import mpmath

        from proof.judges.digits import ASIDE, MOST_STEPS, SMALL, curve, numbers, solved

        surface = self.surface
        origin = numbers(surface.origin)
        frame = [numbers(v) for v in (surface.axis, surface.radial, surface.binormal)]
        profiles = [
            [
                numbers(point) if w is None else [x * w[k] for x in (*numbers(point), 1)]
                for k, point in enumerate(segment)
            ]
            for segment, given in zip(surface.segments, surface.weights, strict=True)
            for w in (None if given is None else numbers(given),)
        ]

        def solve(patch: int, _u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
            start = solved(frame, [a - b for a, b in zip(o, origin, strict=True)])
            way = solved(frame, d)
            assert start is not None
            assert way is not None
            x = numbers((v, t))
            for _ in range(MOST_STEPS):
                (z, r), (dz, dr) = _quotient(*curve(profiles[patch], x[0]))
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


def _quotient(sums: Vector, slopes: Vector) -> tuple[Vector, Vector]:
    """Return Z and R, and their derivatives, of which these are the sums (with weights, w last)."""
    if len(sums) == 2:
        return sums, slopes
    (*scaled, w), (*of_scaled, dw) = sums, slopes
    point = [x / w for x in scaled]
    return point, [(x - dw * p) / w for x, p in zip(of_scaled, point, strict=True)]
