"""First hits at whole and trimmed NURBS surfaces against those of OpenCASCADE."""

import numpy as np
import pytest

from hybrid_rt import Intersector, Rectangle
from hybrid_rt.analysis.ray_sets import at_box
from meshing import NurbsSurface, TrimmedSurface, circle, polygon
from proof.cases.rational_surfaces import nurbs_sphere, rational_sheet
from proof.cases.trimmed_surfaces import trimmed_sheet
from proof.exact.truth import ExactScene, exact_hits
from proof.judges.judge import compare

opencascade = pytest.importorskip("proof.judges.opencascade", reason="needs OCP")

OUTLINE = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])


def windowed_ball():
    """The NURBS sphere with a round window and a square one, each across borders of patches."""
    window = polygon([(0.65, 0.4), (0.8, 0.45), (0.78, 0.7), (0.6, 0.6)])
    return TrimmedSurface(nurbs_sphere(), [OUTLINE, circle((0.25, 0.5), (0.1, 0.2)), window])


@pytest.mark.slow
@pytest.mark.parametrize("make", [nurbs_sphere, rational_sheet, trimmed_sheet, windowed_ball])
def test_first_hits_are_those_of_opencascade(make):
    surface = make()
    rays = at_box([surface], 10_000, 1)
    directions = rays.directions / np.linalg.norm(rays.directions, axis=1)[:, None]
    hits = Intersector([surface]).intersect(rays.origins, directions)
    theirs = opencascade.first_hits(surface, rays.origins, directions)
    assert 0.3 < np.isfinite(theirs).mean() < 0.9
    is_same = (theirs == hits.t) | (np.abs(np.where(hits.hit, hits.t, 0.0) - theirs) < 1e-10)
    # It misses roots now and then; where the two differ, exact arithmetic decides.
    other = np.flatnonzero(~is_same)
    assert len(other) < 30
    truth = exact_hits(ExactScene([surface]), rays.origins[other], directions[other])
    verdict = compare(hits[other], truth)
    assert (verdict.n_wrong, verdict.undecided) == (0, 0)


def test_a_hit_of_another_sheet_would_be_noticed():
    # A plane as a spline: the way is known.
    net = [[(x, y, 0.0) for y in (-1.0, 1.0)] for x in (-1.0, 1.0)]
    plane = NurbsSurface(net, [0, 0, 1, 1], [0, 0, 1, 1], 1)
    holed = TrimmedSurface(plane, [OUTLINE, circle((0.5, 0.5), 0.25)])
    origins = np.array([(0.1, 0.2, 2.0), (0.7, 0.2, 2.0), (1.1, 0.0, 2.0)])
    down = np.tile([0.0, 0.0, -1.0], (3, 1))
    assert opencascade.first_hits(plane, origins, down).tolist() == [2.0, 2.0, np.inf]
    assert opencascade.first_hits(holed, origins, down).tolist() == [np.inf, 2.0, np.inf]


def test_other_surfaces_are_refused_by_name():
    with pytest.raises(TypeError, match="compares NurbsSurface, not Rectangle"):
        opencascade.as_face(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)))
