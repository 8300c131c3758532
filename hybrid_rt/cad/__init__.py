"""CAD files: STEP, IGES and BREP faces as the surfaces that they are.

`hybrid_rt.cad.model` has `read_cad`; the process that it starts imports little of this package.
"""
