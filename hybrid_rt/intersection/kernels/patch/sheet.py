"""Parameters of patches made those of their sheet, for the hits of a batch."""

import numpy as np

from meshing.kernels.jit import kernel


@kernel
def name_on_sheet(object_id, number, spans, patch_id, u, v):
    """Replace u and v of the hits on one object by those across its sheet.

    ``object_id`` (n,) int32; ``patch_id`` (n,) int32; ``u``, ``v`` (n,), changed.
    ``number``: the sheet's.
    ``spans`` (k, 4): u0, u1, v0, v1 of each patch.
    """
    for i in range(object_id.shape[0]):
        if object_id[i] == number:
            span = spans[np.int64(patch_id[i])]
            u[i] = span[1] if u[i] == 1.0 else span[0] + u[i] * (span[1] - span[0])
            v[i] = span[3] if v[i] == 1.0 else span[2] + v[i] * (span[3] - span[2])
