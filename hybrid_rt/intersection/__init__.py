"""Ray-surface intersection: `Intersector` and its stages.

`kernels` solves for the hits (Bezier patches: `kernels.patch`), `kinds` builds the kernels' tables,
`coarse` is Embree.
"""

from hybrid_rt.intersection.intersector import Intersector

__all__ = ["Intersector"]
