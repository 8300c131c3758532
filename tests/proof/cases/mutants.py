"""Mutation testing of the tracer's proofs: each mutant changes one line.

A mutant is data: a function or constant, and the text to replace in it. It is applied to a copy of
the packages, whose kernels are compiled anew. The copy traces hard rays at singular sets, and rows
that differ from those of the original are passed to the exact judge. A set of rays detects the
mutant if a row has a fault that the original does not have.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

PACKAGES = ("hybrid_rt", "meshing")


@dataclass(frozen=True)
class Mutant:
    """A change that weakens one proof.

    ``where``: name of a function or a constant at the top of a module, wherever in the packages it is.
    ``old``, ``new``: text that occurs once in its source, and its replacement.
    ``weakens``: what is no longer proven.
    ``kinds``: kinds of singular sets that may detect it (`singular_sets.KINDS`).
    """

    name: str
    where: str
    old: str
    new: str
    weakens: str
    kinds: tuple[str, ...]


PATCHES, TURNED, CLOSED, MESH = ("patches",), ("turned",), ("closed",), ("mesh",)
RATIONAL = ("rational",)
MUTANTS = (
    # --- patches: cells
    Mutant(
        "fans halved", "fill_cell",
        "record[FAN], record[FAN + 1] = fan_u + margin * lp, fan_v + margin * lq",
        "record[FAN], record[FAN + 1] = 0.5 * fan_u, 0.5 * fan_v",
        "at most one root in a cell", PATCHES,
    ),
    Mutant(
        "fans without margin", "fill_cell",
        "record[FAN], record[FAN + 1] = fan_u + margin * lp, fan_v + margin * lq",
        "record[FAN], record[FAN + 1] = fan_u, fan_v",
        "rounding of the fan", PATCHES,
    ),
    Mutant(
        "fan test without slack", "FAN_SLACK",
        "2.0**-50 * (1.0 + 2.0 * WIDEST)", "0.0",
        "rounding of the ray in the fan's basis", PATCHES,
    ),
    Mutant(
        "roots beside a grown cell settle it", "solve_cell",
        "grown = 1.0 + 2.0 * GROWTH", "grown = 4.0",
        "one root in the grown cell", PATCHES,
    ),
    # --- rational patches
    Mutant(
        "fans of rational cells by half their cross products", "_by_pairs",
        "for b in range(n_v):", "for b in range(n_v // 2):",
        "at most one root in a cell", RATIONAL,
    ),
    Mutant(
        "hodographs without weights", "_hodograph_cone",
        "x += factor * (q[3] * p[0] - p[3] * q[0])", "x += factor * (p[0] - q[0])",
        "at most one root in a cell", RATIONAL,
    ),
    # --- patches: roots
    Mutant(
        "t_bound of patches a quarter", "offer_root",
        "t_bound = (2.0 * error / n_dot_d", "t_bound = (0.5 * error / n_dot_d",
        "bound of t", PATCHES,
    ),
    # --- patches: bisection
    Mutant(
        "Krawczyk without rounding term", "_test_piece",
        "turn_v1) + (degree_u + degree_v) * rounding", "turn_v1)",
        "rounding in Krawczyk's test", PATCHES,
    ),
    Mutant(
        "Krawczyk's test passed at q < 3", "_test_piece",
        "if not q < 1.0:", "if not q < 3.0:",
        "at most one root in a piece", PATCHES,
    ),
    Mutant(
        "Newton from pieces that turn", "NEWTON_TURN", "0.25", "0.95",
        "Newton converges to the piece's root", PATCHES,
    ),
    Mutant(
        "neighbouring pieces without slack", "BORDER_SLACK", "1e-9", "-1e-3",
        "no gap between neighbouring pieces", PATCHES,
    ),
    Mutant(
        "long thin pieces taken for touches", "slow_solve",
        "fold = 4.0 * np.sqrt", "fold = 4e3 * np.sqrt",
        "t_bound of touches", PATCHES,
    ),
    Mutant(
        "large pieces taken for points", "slow_solve",
        "is_point = max(f1 - f0, g1 - g0, h1 - h0) <= 4.0 * slop",
        "is_point = max(f1 - f0, g1 - g0, h1 - h0) <= 4e4 * slop",
        "a point's t and place", PATCHES,
    ),
    Mutant(
        "slopes of points overstated", "_steepness",
        "return abs(nx * dx + ny * dy + nz * dz) / length",
        "return 8.0 * abs(nx * dx + ny * dy + nz * dz) / length",
        "bound of t at points", PATCHES,
    ),
    # --- tree and frame
    Mutant(
        "far sides of boxes without growth", "FAR_GROWTH",
        "np.float32(8 * 2.0**-23)", "np.float32(0)",
        "rounding of float32 boxes", (*PATCHES, *MESH),
    ),
    Mutant(
        "search cut too early", "end_of",
        "return t + CUT_SLACK * (1.0 + abs(t))", "return t - CUT_SLACK * (1.0 + abs(t))",
        "roots that neighbours share", (*PATCHES, *TURNED),
    ),
    Mutant(
        "origins rounded on their way into the frame", "two_difference",
        "return s, (a - (s - z)) - (b + z)", "return s, 0.0",
        "far scenes without loss", (*PATCHES, *TURNED, *CLOSED),
    ),
    Mutant(
        "departure's radius a sixteenth", "POINT_ROUNDING",
        "8 * 2.0**-53", "0.5 * 2.0**-53",
        "the point of departure is not met again", (*PATCHES, *TURNED, *CLOSED, *MESH),
    ),
    Mutant(
        "departure without bound of t", "is_known",
        "t_bound * n_dot_d + radius", "radius",
        "the point of departure is not met again", (*PATCHES, *TURNED, *CLOSED, *MESH),
    ),
    Mutant(
        "departure hides what is near", "is_known",
        "t_bound * n_dot_d + radius", "1e5 * (t_bound * n_dot_d + radius)",
        "other crossings near the departure", (*PATCHES, *TURNED, *CLOSED, *MESH),
    ),
    # --- surfaces of revolution
    Mutant(
        "roots beside a grown piece settle it", "solve_single",
        "a - GROWTH * (b - a) <= s <= b + GROWTH * (b - a)",
        "a - 4.0 * GROWTH * (b - a) <= s <= b + 4.0 * GROWTH * (b - a)",
        "one root in the grown piece", TURNED,
    ),
    # --- closed forms and meshes
    Mutant(
        "bound of spheres a quarter", "offer_sphere",
        "error_half = (", "error_half = 0.25 * (",
        "bound of t", CLOSED,
    ),
    Mutant(
        "bound of near roots of spheres a 64th", "offer_sphere",
        "error_near = abs(near) * (error_far / abs(far) + 8.0 * u)",
        "error_near = abs(near) * (error_far / abs(far) + 8.0 * u) / 64.0",
        "bound of t", CLOSED,
    ),
    Mutant(
        "power of a point rounded", "power_of_point",
        "return high + (low + 2.0 * (fx * gx + fy * gy + fz * gz))", "return high",
        "t beside large spheres", CLOSED,
    ),
    Mutant(
        "TANGENT of spheres 64 times as narrow", "offer_sphere",
        "band = TANGENT_BAND * max(away, 2.0 * r)", "band = TANGENT_BAND / 64 * max(away, 2.0 * r)",
        "the mark at silhouettes", CLOSED,
    ),
    Mutant(
        "bound of rectangles an eighth", "offer_parallelogram",
        "error = UNIT_ROUNDOFF * (12.0 * away + 4.0 * size[k])",
        "error = UNIT_ROUNDOFF * (1.5 * away + 0.5 * size[k])",
        "bound of t, rims", CLOSED,
    ),
    Mutant(
        "rectangles out of reach without slack", "CLEARANCE", "2.0**-38", "0.0",
        "roots and doubts at rims", CLOSED,
    ),
    Mutant(
        "spheres out of reach without slack", "SURE", "2.0**-40", "0.0",
        "roots and doubts at silhouettes", CLOSED,
    ),
    Mutant(
        "bound of planes an eighth", "offer_plane",
        "error = UNIT_ROUNDOFF * (8.0 * away", "error = 0.125 * UNIT_ROUNDOFF * (8.0 * away",
        "bound of t", CLOSED,
    ),
    Mutant(
        "slopes along planes rounded", "offer_plane",
        "is_nearly_within = abs(n_dot_d) < NEARLY_WITHIN", "is_nearly_within = False",
        "roots far along a plane", CLOSED,
    ),
    Mutant(
        "starts on planes not marked", "doubt_start",
        "if not 0.0 < n_dot_d < NEARLY_WITHIN:", "if True:",
        "the mark where a ray begins on a plane", CLOSED,
    ),
    Mutant(
        "TANGENT of boxes 64 times as narrow", "offer_box",
        "band = TANGENT_BAND * reach", "band = TANGENT_BAND / 64 * reach",
        "the mark at edges", CLOSED,
    ),
    Mutant(
        "bound of triangles an eighth", "offer_triangle",
        "error = UNIT_ROUNDOFF * away * (12.0 + 8.0 * side * side / length)",
        "error = UNIT_ROUNDOFF * away * (1.5 + side * side / length)",
        "bound of t", MESH,
    ),
    Mutant(
        "slivers by plain products", "SLIVER", "3e-2", "0.0",
        "points of triangles seen edge-on", MESH,
    ),
    Mutant(
        "skew boxes without slack", "BOX_SLACK", "2.0**-22", "0.0",
        "rounding of a cell's box", PATCHES,
    ),
    Mutant(
        "bisection's slop a sixteenth", "slow_solve",
        "slop = rounding_of_net(", "slop = 0.0625 * rounding_of_net(",
        "rounding of projected nets", PATCHES,
    ),
    Mutant(
        "Krawczyk's exclusion too wide", "_test_piece",
        "> 1.0 + q + gain * reach", "> 1.0 - 0.5 * q",
        "no root is excluded", PATCHES,
    ),
    Mutant(
        "rounding of turned surfaces a quarter", "rounding",
        "noise = UNIT_ROUNDOFF * (", "noise = 0.25 * UNIT_ROUNDOFF * (",
        "bound of t, bands at ends", TURNED,
    ),
    Mutant(
        "t_bound of turned surfaces a quarter", "offer_meeting",
        "t_bound = (1.25 * error / flat", "t_bound = (0.3 * error / flat",
        "bound of t", TURNED,
    ),
    Mutant(
        "ends of segments without band", "offer_meeting",
        "band = 2.0 * noise * gain + 4.0 * UNIT_ROUNDOFF", "band = 0.0",
        "no gap between segments", TURNED,
    ),
    Mutant(
        "skew boxes too small", "BOX_SLACK", "2.0**-22", "-(2.0**-12)",
        "a cell's box holds the cell", PATCHES,
    ),
    Mutant(
        "a cell's border without slack", "solve_cell",
        "abs(in_u - um) <= hu * (1.0 + BORDER_SLACK) + slack * gain_u",
        "abs(in_u - um) <= hu",
        "no gap between neighbouring cells", PATCHES,
    ),
    Mutant(
        "rounding of patches a quarter", "rounding_of_root",
        "return UNIT_ROUNDOFF * (", "return 0.25 * UNIT_ROUNDOFF * (",
        "bound of t, border bands", PATCHES,
    ),
    Mutant(
        "rounding of S(u, v) a quarter", "rounding_of_root",
        "sums = 4.0 if rational is None or not rational else 8.0",
        "sums = 1.0 if rational is None or not rational else 2.0",
        "bound of t of degrees above 3", PATCHES,
    ),
    Mutant(
        "borders of patches without band", "offer_border",
        "accepted = BORDER * error if band == 0.0 else min(BORDER * error, band)",
        "accepted = 0.0",
        "no gap between neighbouring patches", PATCHES,
    ),
    Mutant(
        "TANGENT at open borders left out", "finish_patches",
        "not (is_alone and du <= in_u and dv <= in_v)", "not is_alone",
        "the mark at open borders", PATCHES,
    ),
    Mutant(
        "TANGENT at silhouettes of patches left out", "finish_patches",
        "not (is_alone and du <= in_u and dv <= in_v)", "not (du <= in_u and dv <= in_v)",
        "the mark at silhouettes", PATCHES,
    ),
    Mutant(
        "rates of a sheet out of order", "rates_in",
        "return min(lo, hi), max(lo, hi)", "return lo, hi",
        "at most one root of rays by the axis", TURNED,
    ),
    Mutant(
        "straight segments missed within the band", "guess_roots",
        "if gap * abs(zs) > ray[BAND] * np.hypot(zs, rs):", "if gap > 0.0:",
        "touches of cones and cylinders", TURNED,
    ),
    Mutant(
        "one meeting proven by half the slopes", "is_transversal",
        "return low > clear or high < -clear",
        "return 0.75 * low + 0.25 * high > clear or 0.25 * low + 0.75 * high < -clear",
        "at most one root of a piece and a sheet", TURNED,
    ),
    Mutant(
        "slop of turned surfaces a 64th", "enter_axis_frame",
        "ray[SLOP] = table.roundings[k] *", "ray[SLOP] = 1.0 / 64.0 * table.roundings[k] *",
        "rounding of boxes and sheets", TURNED,
    ),
    Mutant(
        "chords without slop", "halve_piece",
        "is_near_miss = apart > slop", "is_near_miss = apart > -slop",
        "a piece beside its chord's strip", TURNED,
    ),
    Mutant(
        "heights without slop", "height_range",
        "return low - 2.0 * slack, high + 2.0 * slack",
        "return low + 2.0 * slack, high - 2.0 * slack",
        "segments left out by height", TURNED,
    ),
    Mutant(
        "sheets without slack", "sheet_interval",
        "far = np.sqrt((r1 + slack - h) * (r1 + slack + h)) + slack",
        "far = np.sqrt((r1 + slack - h) * (r1 + slack + h)) - slack",
        "t of a sheet", TURNED,
    ),
    Mutant(
        "TANGENT of hits on boxes left out", "finish_box",
        "best.tangent[i] = WITHIN_BAND", "best.tangent[i] = best.tangent[i]",
        "the mark at edges", CLOSED,
    ),
    Mutant(
        "marks of boxes passed over", "_is_near_outline",
        "> 2.0 * band", "> 0.01 * band",
        "the mark at edges", CLOSED,
    ),
    Mutant(
        "needles by their own normals", "NEEDLE", "16.0", "1e300",
        "points of needles", MESH,
    ),
    Mutant(
        "TANGENT of meshes 64 times as narrow", "band_at",
        "return TANGENT_BAND * max(", "return TANGENT_BAND / 64 * max(",
        "the mark at silhouettes of meshes", MESH,
    ),
)  # fmt: skip


def place_of(root: Path, where: str) -> tuple[Path, int, int]:
    """Find the one function or constant of a name at the top of a module of the packages.

    ``first`` and ``last`` are its lines, from 0; the last is not included.
    Raises ValueError if there is none, or more than one.
    """
    found = []
    for package in PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            text = file.read_text("utf-8")
            if where not in text:
                continue
            for node in ast.parse(text).body:
                names = [node.name] if isinstance(node, ast.FunctionDef) else []
                if isinstance(node, ast.Assign):
                    for target in node.targets:
                        names += [one.id for one in ast.walk(target) if isinstance(one, ast.Name)]
                if where in names:
                    found.append((file, node.lineno - 1, node.end_lineno or node.lineno))
    if not found:
        raise ValueError(f"no function or constant {where!r} in {', '.join(PACKAGES)}")
    return found[0] if len(found) == 1 else _only_one(found, where)


def _only_one(found: list[tuple[Path, int, int]], where: str) -> tuple[Path, int, int]:
    places = ", ".join(str(file) for file, _, _ in found)
    raise ValueError(f"{where!r} is in {places}: name something that is there once")


def applied(root: Path, mutant: Mutant) -> tuple[Path, str]:
    """Return the file that a mutant changes, and its new text.

    Raises ValueError if the text that it changes is not there once.
    """
    file, first, last = place_of(root, mutant.where)
    lines = file.read_text("utf-8").splitlines(keepends=True)
    part = "".join(lines[first:last])
    if part.count(mutant.old) != 1:
        raise ValueError(
            f"mutant {mutant.name!r}: {mutant.old!r} is {part.count(mutant.old)} times in "
            f"{mutant.where} ({file.name}): say anew what it changes"
        )
    part = part.replace(mutant.old, mutant.new)
    return file, "".join([*lines[:first], part, *lines[last:]])
