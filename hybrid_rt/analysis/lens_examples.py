"""Lens prescriptions from the literature, and one that focuses without aberration."""

import math

from hybrid_rt.analysis.lens import Focus, LensSurface

# W. J. Smith, "Modern Optical Engineering", 4th edition, chapter 6: a photographic triplet of Cooke's
# kind, of Schott's SK4 and SF2 (indices at 587.6 nm), in mm; the fifth surface is the stop.
SK4, SF2 = 1.61272, 1.64769
COOKE_TRIPLET = (
    LensSurface(37.40, 5.90, SK4, 29.4),
    LensSurface(-341.48, 12.93, 1.0, 29.4),
    LensSurface(-42.65, 2.50, SF2, 21.6),
    LensSurface(36.40, 2.00, 1.0, 21.6),
    LensSurface(math.inf, 9.85, 1.0, 20.6),
    LensSurface(204.52, 5.90, SK4, 23.2),
    LensSurface(-37.05, 0.0, 1.0, 23.2),
)
COOKE_PRINTED = Focus(101.181, 77.405)
COOKE_HALF_FIELD = 11.86

# W. J. Smith, "Modern Lens Design", 1992, page 304: a double Gauss lens of f / 1.25 after Werfeli, US
# 2,771,006, in mm; two surfaces are cemented, the sixth is the stop.
DOUBLE_GAUSS = (
    LensSurface(93.320, 11.320, 1.717, 80.0),
    LensSurface(358.290, 0.400, 1.0, 80.0),
    LensSurface(46.320, 20.000, 1.643, 72.0),
    LensSurface(math.inf, 2.000, 1.589, 72.0),
    LensSurface(28.680, 14.000, 1.0, 49.0),
    LensSurface(math.inf, 10.000, 1.0, 48.6),
    LensSurface(-41.320, 6.000, 1.762, 48.0),
    LensSurface(60.800, 22.000, 1.744, 60.0),
    LensSurface(-55.000, 13.000, 1.0, 60.0),
    LensSurface(90.200, 16.000, 1.717, 56.0),
    LensSurface(-212.580, 0.0, 1.0, 56.0),
)
DOUBLE_GAUSS_PRINTED = Focus(100.1, 56.42)


def stigmatic_singlet(
    index: float = 1.5, focal_length: float = 50.0, aperture: float = 60.0, thickness: float = 25.0
) -> tuple[LensSurface, LensSurface]:
    """Return a lens whose back is the hyperboloid k = -n^2: parallel light meets in one point.

    Descartes' oval of an object at infinity: behind the plane front all paths to the focus are as
    long. The focal length is |R| / (n - 1) (Born and Wolf, "Principles of Optics", section 4.2).
    """
    radius = -focal_length * (index - 1.0)
    return (
        LensSurface(math.inf, thickness, index, aperture),
        LensSurface(radius, 0.0, 1.0, aperture, -(index**2)),
    )
