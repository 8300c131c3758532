"""The ladder of meshes: measured deviations stay within what is proven, errors fall with them."""

import json

import imageio.v3 as imageio
import numpy as np
import pytest

from hybrid_rt.analysis.mesh_error import climb
from hybrid_rt.core.plain_records import as_json
from proof.cases.scenes import torus


def test_errors_fall_with_the_tolerance(tmp_path):
    coarse, fine = climb([torus()], (3e-2, 3e-3), 3000)
    for rung in (coarse, fine):
        assert rung.worst <= rung.bound <= rung.tolerance
        assert 0.0 < rung.mean < rung.worst
    assert fine.triangles > 5 * coarse.triangles
    assert fine.mean_angle < 0.5 * coarse.mean_angle
    for kind in ("random", "camera"):
        # Errors of t are those of the surface over the cosine.
        assert fine.errors["mesh"][kind].mean < 0.3 * coarse.errors["mesh"][kind].mean
        # After Newton the right hits are exact, but as many decisions are wrong.
        assert coarse.errors["refined"][kind].mean < 1e-12
        assert coarse.errors["refined"][kind].worst < 1e-8
        assert coarse.errors["refined"][kind].wrong > 1e-3
    assert np.isfinite(list(fine.microseconds["certified"].values())).all()
    # What is drawn is what the tool's table.json holds.
    pytest.importorskip("matplotlib")
    from hybrid_rt.analysis.mesh_diagrams import draw_time

    rows = json.loads(as_json([rung.figures for rung in (coarse, fine)]))
    assert rows[0]["errors"]["mesh"]["camera"]["wrong"] == coarse.errors["mesh"]["camera"].wrong
    draw_time(rows, "torus", tmp_path / "a.png")
    assert imageio.imread(tmp_path / "a.png").shape[1] == 924
