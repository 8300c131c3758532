"""Rows that cases of the catalogue hold, and rays at singular sets, mostly at 1e-1 to 1e-14 of the size."""

from __future__ import annotations

from typing import Any

from proof.cases.catalogue import CATALOGUE
from proof.stability.measure_exact import by_set, catalogue
from proof.stability.row import Effort, Outcome, row

TIP, POLE = "distance from a tip / size", "distance from a rounded pole / size"
SPINDLE, TANGENCY = "distance from a spindle / size", "distance from tangency / size"
WITHIN = "sine of the angle with the surface"
COSINES = tuple(10.0**-k for k in range(3, 17))
# Singular sets by row: their rays at each distance, what the distance is, and options of `by_set`. Needles,
# spindles and what is seen along its tangent plane lie between the rays that are moved around them:
# those tell of few marks.
FEW: dict[str, Any] = {"marks": False}
BEYOND: dict[str, Any] = {"placement": "far"}
SETS: dict[str, tuple[tuple[str, int, str, dict[str, Any]], ...]] = {
    "A01": (("patch tangents", 100, TANGENCY, {}),),
    "A03": (("flat patch, nearly within", 20, WITHIN, FEW),),
    "A04": (("rulings, nearly within", 20, WITHIN, FEW),),
    "A08": (("apex of the lid", 12, "distance from a collapsed apex / size", {}),),
    "A15": (("patches, leaving", 40, "cosine of the departure", {}),),
    "A21": (("uneven patch corner", 16, "distance from a crowded corner / size", {}),),
    "B16": (("torus, tangents", 100, TANGENCY, {}),),
    "C09": (("sphere, tangents", 40, TANGENCY, {}),),
    "F01": (
        ("cone tip", 100, TIP, {}), ("lens tips", 100, TIP, {}), ("flat cone tip", 40, TIP, {}),
        ("needle tip", 40, TIP, FEW), ("cone tip, leaving", 40, TIP, {}),
    ),
    "F02": (
        ("paraboloid pole", 100, POLE, {}), ("egg poles", 100, POLE, {}),
        ("ball poles", 40, POLE, {}), ("paraboloid pole, leaving", 40, POLE, {}),
    ),
    "F03": (
        ("spindle", 100, SPINDLE, FEW), ("sharp spindle", 40, SPINDLE, FEW),
        ("cone tip", 20, TIP, BEYOND), ("egg poles", 20, POLE, BEYOND),
    ),
    "F04": (("uneven lune", 40, "distance from a lune's pole / size", FEW),),
    "F07": tuple(
        (name, 40, "cosine between ray and normal", {"distances": COSINES, **FEW})
        for name in ("flat patch, nearly within", "flat bicubic, nearly within")
    ),
    # A mark must stand where moving the ray by an eighth of the band of the surface's size changes the
    # first hit, and must not where moving it by four bands of the ray does not.
    "F08": tuple(
        (name, 40, "distance from a singular set / size", {
            "distances": (1e-12, 1e-13, 3e-14, 1e-14, 3e-15, 1e-15, 1e-16), "from_afar": True,
        })
        for name in (
            "cone tip", "paraboloid pole", "apex of the lid", "collapsed edge", "joint, sharp", "rim",
            "shared edge, sharp", "open border", "box edges and corners", "open mesh, edges",
        )
    ),
}  # fmt: skip
# Id, title, and truth.
ROWS = (
    ("A01", "rays near a silhouette", "exact arithmetic"),
    ("A03", "ray lying in a flat patch", "exact arithmetic"),
    ("A04", "ray along a straight line of a ruled patch", "exact arithmetic"),
    ("A05", "bilinear patch that is not flat", "exact arithmetic"),
    ("A08", "collapsed edge", "exact arithmetic; closed form"),
    ("A11", "patch through itself", "exact arithmetic"),
    ("A12", "two coincident patches", "exact arithmetic"),
    ("A13", "shared edges and corners", "exact arithmetic"),
    ("A15", "rays that leave the surface", "exact arithmetic"),
    ("A21", "extremely uneven parametrisation", "exact arithmetic"),
    ("A22", "wavy patch of degree 12", "exact arithmetic"),
    ("A23", "origin on the surface", "closed form"),
    ("A24", "origin inside boxes of pieces", "closed form"),
    ("A25", "pointing away from everything", "closed form"),
    ("A30", "one patch only", "exact arithmetic"),
    ("B05", "ray through the axis", "closed form; exact arithmetic"),
    ("B07", "tips of cones", "closed form"),
    ("B09", "profile on the axis over an interval", "exact arithmetic"),
    ("B10", "profile with a loop", "exact arithmetic"),
    ("B11", "open profile", "exact arithmetic"),
    ("B13", "discs and cylinders", "closed form; exact arithmetic"),
    ("B14", "joints of a profile", "exact arithmetic"),
    ("B16", "grazing the equators", "exact arithmetic"),
    ("B18", "a wire of radius 1e-9", "closed form"),
    ("C09", "ray exactly tangent", "exact arithmetic"),
    ("C12", "radius 1e-9 and 1e9 in one scene", "high precision; exact roots"),
    ("D02", "directions of length 1e-300 and 1e300", "closed form"),
    ("D05", "components of direction 0 and -0", "closed form"),
    ("F01", "beside the tip of a turned surface", "exact arithmetic"),
    ("F02", "beside a rounded pole", "exact arithmetic"),
    ("F03", "beside a spindle; an axis far from the origin", "exact arithmetic"),
    ("F04", "patch with two poles and unequal degrees", "exact arithmetic"),
    ("F07", "ray almost within a flat patch", "exact arithmetic"),
    ("F08", "decisions within rounding", "exact arithmetic, of moved rays"),
    ("C10", "concentric spheres 1e-12 apart", "high precision"),
)


def _register(row_id: str, title: str, truth: str) -> None:
    @row(row_id, title, truth)
    def run(effort: Effort) -> Outcome:
        total = Outcome()
        if any(case.id == row_id for case in CATALOGUE):
            total += catalogue(row_id, effort)
        for name, rays, against, options in SETS.get(row_id, ()):
            total += by_set(name, effort, rays, against=against, **options)
        return total


for _row in ROWS:
    _register(*_row)
