"""Materials: diffuse, glossy, metal, mirror, glass (`dielectric`, `rough_dielectric`), mixtures.

A material is a list of lobes; `hybrid_rt.shading.kernels` evaluates and samples them.
"""

from hybrid_rt.materials.dielectric import Dielectric
from hybrid_rt.materials.emissive import Emissive
from hybrid_rt.materials.lambertian import Lambertian
from hybrid_rt.materials.metal import Metal
from hybrid_rt.materials.mirror import Mirror
from hybrid_rt.materials.mix import Mix
from hybrid_rt.materials.phong import Phong

__all__ = ["Dielectric", "Emissive", "Lambertian", "Metal", "Mirror", "Mix", "Phong"]
