"""The table of tori."""

from typing import Any, NamedTuple

import numpy as np


class TorusTable(NamedTuple):
    """Tori, each with a frame in which R + r is from 1/2 to 1; row k is object ``object_id[k]``."""

    origin: Any  # (k, 4) world; and, in the frame, `meshing.surface.Surface.moved`
    size: Any  # (k,) world: R + r; more, if rounding has moved an image
    frame: Any  # (k, 3, 3): rows along u = 0, a quarter turn, the axis
    to_frame: Any  # (k,) powers of two
    major: Any  # (k,) in the frame
    minor: Any  # (k,)
    orientation: Any  # (k,): 1 normals outward, -1 inward
    object_id: Any  # (k,) int32
    trim: Any  # None: they are whole; else `search.trims.Trim`


def torus_table(tori, object_id, trim=None):
    """Return the table of a list of tori, and of the loops that trim all of them."""
    size = np.array([torus.major_radius + torus.minor_radius for torus in tori])
    to_frame = 2.0 ** -np.ceil(np.log2(size))
    moved = np.array([torus.moved for torus in tori])
    return TorusTable(
        origin=np.column_stack([[torus.origin for torus in tori], moved * to_frame]),
        size=size + 2.0 * moved,
        frame=np.array([np.stack([t.radial, t.binormal, t.axis]) for t in tori]),
        to_frame=to_frame,
        major=np.array([torus.major_radius for torus in tori]) * to_frame,
        minor=np.array([torus.minor_radius for torus in tori]) * to_frame,
        orientation=np.array([float(torus.orientation) for torus in tori]),
        object_id=object_id,
        trim=None if trim is None else trim._replace(gap=trim.gap * to_frame),
    )
