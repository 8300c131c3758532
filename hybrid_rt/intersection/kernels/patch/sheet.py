"""Parameters of patches made those of their sheet, for the hits of a batch."""

from meshing.kernels.jit import kernel


@kernel
def name_on_sheets(object_id, first, spans, patch_id, u, v):
    """Replace u and v of hits on sheets by those across the whole sheet.

    ``object_id`` (n,) int32; ``patch_id`` (n,) int32; ``u``, ``v`` (n,), changed.
    ``first`` (objects,) int64: the row of ``spans`` of the first patch of each; -1: no sheet, as those
    beyond the last.
    ``spans`` (k, 4): u0, u1, v0, v1 of each patch.
    """
    for i in range(object_id.shape[0]):
        k = object_id[i]
        if 0 <= k < first.shape[0] and first[k] >= 0:
            span = spans[first[k] + patch_id[i]]
            u[i] = span[1] if u[i] == 1.0 else span[0] + u[i] * (span[1] - span[0])
            v[i] = span[3] if v[i] == 1.0 else span[2] + v[i] * (span[3] - span[2])


@kernel
def name_parts(best, kind_of, kind, group, part):
    """Write the part of each hit on a patch, -1 for other rows, into ``part`` (n,) int32.

    ``group`` (patches,) int64. The rest is as in `finish_patches`.
    """
    for i in range(part.shape[0]):
        is_own = best.object_id[i] >= 0 and kind_of[best.object_id[i]] == kind
        part[i] = group[best.primitive[i]] if is_own else -1
