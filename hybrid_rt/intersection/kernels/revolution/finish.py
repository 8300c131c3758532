"""What is known of hits on surfaces of revolution: refined without proof, and described."""

import numpy as np

from hybrid_rt.core.kernels.arctangent import angle_of
from hybrid_rt.intersection.kernels.revolution.loops import TURN, side_by_curves, turn_within
from hybrid_rt.intersection.kernels.revolution.outlines import is_outline
from hybrid_rt.intersection.kernels.revolution.profile import (
    BEGIN,
    SHARE,
    profile,
    segment_of,
    summed_degree,
)
from hybrid_rt.intersection.kernels.revolution.sheets import (
    ACROSS,
    BAND,
    COSINE,
    HEIGHT,
    IN_PART,
    LENGTH,
    RISE,
    SIDE,
    SINE,
    WAY,
    bend_of_ray,
    distance,
    enter_axis_frame,
    shift_to_end,
)
from hybrid_rt.intersection.kernels.revolution.solve import meet, offer_meeting, rounding
from hybrid_rt.intersection.kernels.search.coarse import parameters_at
from hybrid_rt.intersection.kernels.search.nearest import is_unseen
from hybrid_rt.intersection.kernels.search.rays import EDGE, NORMAL_DEGENERATE
from hybrid_rt.intersection.kernels.search.tolerances import UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.trims import across_rows, sure_side
from meshing.kernels.jit import kernel
from meshing.kernels.trims import CROSSED


@kernel
def refine_revolutions(table, hits, triangles, row_of, rows, rays, best, ray, accepted):
    """Newton from coarse hits, with no proof of anything (accuracy "refined")."""
    for j in range(hits.face.shape[0]):
        i, f = rows[j], hits.face[j]
        k = row_of[triangles.object_id[f]]
        if k < 0 or is_unseen(i, triangles.object_id[f], rays.known):
            continue
        o, d = rays.origin[i], rays.direction[i]
        shift = enter_axis_frame(k, table, o[0], o[1], o[2], d[0], d[1], d[2], ray)
        for seg in range(table.first_segment[k], table.first_segment[k + 1]):
            if table.segment_id[seg] != triangles.piece[f]:
                continue
            _, s = parameters_at(triangles, f, hits.u[j], hits.v[j])
            begin = hits.t[j] * table.to_frame[k] - shift
            after = ray[WAY] + begin * ray[ACROSS] >= 0.0
            at, way = seg, 0
            # Triangles may be wider than segments are long: from an end that Newton's iteration
            # leaves by, it goes on along the profile, never back.
            while table.first_segment[k] <= at < table.first_segment[k + 1]:
                segment = segment_of(table, k, at)
                sums = summed_degree(segment.control, segment.start, segment.degree)
                noise, error = rounding(sums, table.size[k], ray, begin)
                ok, s, root, _, slope, gain = meet(
                    segment.control, segment.start, segment.degree, ray, after, s, begin, noise
                )
                if ok:
                    _, is_offered = offer_meeting(
                        i, s, root, slope, gain, noise, error, segment, ray, after, rays, best
                    )
                    if is_offered:
                        accepted[j] = True
                        break
                step = 1 if s > 1.0 else (-1 if s < 0.0 else 0)
                if step in (0, -way):
                    break
                way, at, s = step, at + step, 0.0 if step > 0 else 1.0
            break


@kernel
def finish_revolutions(table, rays, best, row_of, ray, out):
    """Describe the hits on surfaces of revolution; ``row_of`` (objects,): row here, or -1."""
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or row_of[best.object_id[i]] < 0:
            continue
        k, seg, s = row_of[best.object_id[i]], best.primitive[i], best.b[i]
        to_frame, e = table.to_frame[k], table.turn[k]
        control, start, degree = table.control, table.start[seg], table.degree[seg]
        o, d = rays.origin[i], rays.direction[i]
        shift = enter_axis_frame(k, table, o[0], o[1], o[2], d[0], d[1], d[2], ray)
        t = best.t[i] * to_frame - shift
        z, r, zs, rs, zz, rr = profile(control, start, degree, s)
        w, side = ray[WAY] + t * ray[ACROSS], ray[SIDE]
        rho, rate = distance(ray, t, w >= 0.0)
        ex, ey = 1.0, 0.0
        if rho > 0.0:
            ex = (w * ray[COSINE] - side * ray[SINE]) / rho
            ey = (w * ray[SINE] + side * ray[COSINE]) / rho
        if zs * zs + rs * rs <= 1e-28 * table.size[k] * table.size[k]:
            # A resting point of the profile: its direction a little further in.
            inside = s * (1.0 - 2e-6) + 1e-6
            _, _, zs, rs, _, _ = profile(control, start, degree, inside)
            out.flags[i] |= NORMAL_DEGENERATE
        speed = np.hypot(zs, rs)
        zs, rs = zs / speed, rs / speed
        nr, nz = zs, -rs
        bend = nr * bend_of_ray(ray, rho)
        bend -= (zs * rr - rs * zz) / (speed * speed) * (zs * ray[RISE] + rs * rate) ** 2
        if is_outline(table.end[seg], table.size[k], ray, z, r, t, nr, nz, bend):
            best.tangent[i] = 1
        if ray[IN_PART] != 0.0:
            to_end = shift_to_end(ray, t, abs(nr * rate + nz * ray[RISE]))
            if to_end <= ray[BAND]:
                best.tangent[i] = 1
        if r <= 4.0 * UNIT_ROUNDOFF * table.size[k]:
            # On the axis: the normal of a tip is the axis; a smooth pole has no other.
            if abs(zs) > 1e-6:
                out.flags[i] |= NORMAL_DEGENERATE
            if rs != 0.0:
                nr, nz = 0.0, (-1.0 if rs > 0.0 else 1.0)
        px, py = max(r, 0.0) * ex, max(r, 0.0) * ey
        gap = np.sqrt((max(r, 0.0) - rho) ** 2 + (z - ray[HEIGHT] - t * ray[RISE]) ** 2)
        px, py, z = px + table.aside[k, 0], py + table.aside[k, 1], z + table.aside[k, 2]
        for c in range(3):
            local = px * e[0, c] + py * e[1, c] + z * e[2, c]
            out.position[i, c] = table.middle[k, c] + local / to_frame
            out.normal[i, c] = nr * (ex * e[0, c] + ey * e[1, c]) + nz * e[2, c]
        share = table.part[k, SHARE]
        turn = turn_within(angle_of(ey, ex) / TURN, table.part[k, BEGIN], share)
        out.u[i] = min(turn / share, 1.0)
        slope = abs(nr * rate + nz * ray[RISE]) / ray[LENGTH]
        along = TURN * max(r, 0.0)
        room = (slope * along) ** 2
        if (
            sure_side(table.trim, seg, turn, s, 1.0, (along / speed) ** 2, ray[BAND], room)
            == CROSSED
        ):
            _, is_within, edge = side_by_curves(
                table.trim, seg, table.end[seg], turn, s, along, zs * speed, rs * speed, ray, t
            )
            if is_within:
                best.tangent[i] = 1
            if edge > 0.0:
                out.flags[i] |= EDGE
        out.v[i] = across_rows(table.trim, seg, s)
        out.patch_id[i] = table.segment_id[seg]
        out.residual[i] = gap / to_frame
