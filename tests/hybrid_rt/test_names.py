"""Public names of the package."""

import subprocess
import sys

import pytest

import hybrid_rt
import meshing


def test_surfaces_and_curves_of_meshing_are_names_of_both_packages():
    shared = set(meshing.__all__) & set(hybrid_rt.__all__)
    assert set(meshing.__all__) - shared == {"CertifiedMesh", "tessellate"}
    for name in shared:
        assert getattr(hybrid_rt, name) is getattr(meshing, name)


@pytest.mark.parametrize("name", ["tessellate", "Sphree"])
def test_other_names_are_refused(name):
    with pytest.raises(AttributeError, match=f"module 'hybrid_rt' has no attribute '{name}'"):
        getattr(hybrid_rt, name)


def test_the_package_alone_and_a_closed_form_load_no_free_forms():
    code = """
import sys
import hybrid_rt
first = set(sys.modules)
hybrid_rt.Sphere((0, 0, 0), 1.0)
print({"numpy", "meshing"} & first, {"meshing.bezier", "meshing.trimmed", "embreex"} & set(sys.modules))
hybrid_rt.Cone
print("meshing.turned_shapes" in sys.modules, "meshing.tessellation" in sys.modules)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=120
    )
    assert done.stdout.splitlines() == ["set() set()", "True False"]
