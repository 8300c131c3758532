"""The table of closest-point queries: sheets, their cells, and a tree over these.

A *sheet* is one map of the unit square: a Bezier patch, or a profile turned about an axis. A *cell* is a part
of one (`PATCH`, `TURNED`, a `TRIANGLE`) or of a curve that ends it (`EDGE`). In units of its half widths, t in
[-1, 1], each cell has bounds on first, second and third derivatives: so what a part of it is away from its
tangent plane is known without a control net.

All lengths are in the frame of a group: shifted, and scaled by a power of two, so that it is within 1 of 0.
"""

from typing import Any, NamedTuple

PATCH, TURNED, TRIANGLE, EDGE = 0, 1, 2, 3
# What is known of a cell: wholly inside the loops, or not.
WHOLE, CUT = 0, 1

# Columns of `Cells.number`: the part of the sheet (u0, u1, v0, v1), or of a curve (s0, s1); the middle; the
# derivatives there; how far the cell is from these; bounds on derivatives of all orders up to three.
BOX, MIDDLE, ALONG_U, ALONG_V, OFF, BOUNDS = 0, 4, 7, 10, 13, 14
# Of turned cells: cosine and sine of the first and of the last azimuth, then those of the arc of the profile.
AZIMUTH, TUBE = 17, 21
CELL_NUMBERS = 25
# Columns of `Cells.whole`.
KIND, SHEET, STATE, ARC, DEGREE, CHECKED = 0, 1, 2, 3, 4, 5
CELL_INTEGERS = 6

# Profiles of turned sheets, beside BEZIER, of which patches are, too.
BEZIER, CIRCLE, SAG = 0, 1, 2
# Columns of `Sheets.whole`: profile, first row of the net, degrees (that of a profile in v), whether there
# are weights, the member in the table of loops or -1, object, patch.
FORM, NET, DEGREE_U, DEGREE_V, RATIONAL, LOOPS, OBJECT, PIECE, IS_TURNED = 0, 1, 2, 3, 4, 5, 6, 7, 8
SHEET_INTEGERS = 9
# Columns of `Sheets.number`: the rectangle of (u, v) of the whole surface that the sheet fills; the error of
# its points; origin, radial, binormal and axis; first and last azimuth; six numbers of the profile.
SPAN, ERROR, FRAME, TURN, PROFILE = 0, 4, 5, 17, 19
SHEET_NUMBERS = 25


class Shapes(NamedTuple):
    """All that kernels know of surfaces."""

    cell: Any  # (c, 25) float64
    cell_id: Any  # (c, 6) int64
    sheet: Any  # (k, 25) float64
    sheet_id: Any  # (k, 9) int64
    net: Any  # (t, 4) float64: (w x, w y, w z, w); of curves and profiles (w x, w y, 0, w)


class Groups(NamedTuple):
    """The trees over cells, one of each group, and one over the places of the groups."""

    rows: Any  # (n, 8, 8) float32, of all groups
    links: Any  # (n, 8, 8) int32
    order: Any  # (c,) int32: cells
    root: Any  # (g,) int64: first node of each group
    group: Any  # (p,) int64: that of each place
    place: Any  # (p, 15): 9 of a matrix to the frame of the group, and what is subtracted before; the length of a
    # unit of the frame; the largest error of its sheets and its own, in such units; that of the matrix, a part
    top_rows: Any  # the tree over places
    top_links: Any
    top_order: Any  # (p,) int32: places
    frame: Any  # (4,): its centre, and the length of its unit
    depth: int  # how many nodes may wait


class Answers(NamedTuple):
    """Closest points of n points, as they are found."""

    distance: Any  # (n,)
    least: Any  # (n,): what the distance cannot be less than, but for the error
    error: Any  # (n,): of both
    several: Any  # (n,) bool: whether others are as near elsewhere
    u: Any
    v: Any
    position: Any  # (n, 3)
    sheet: Any  # (n,) int64
    piece: Any  # (n,) int64: patch
    place: Any  # (n,) int64
    thing: Any  # (n,) int64: object
    on_edge: Any  # (n,) bool
