"""CAD files: STEP, IGES and BREP faces as the surfaces that they are."""

from hybrid_rt.cad.model import CadModel, CadPart, read_cad

__all__ = ["CadModel", "CadPart", "read_cad"]
