"""Public names of the package."""

import re
import subprocess
import sys

import pytest

import hybrid_rt
import meshing
from hybrid_rt.core.suggestions import _BY_NAME


def test_surfaces_and_curves_of_meshing_are_names_of_both_packages():
    shared = set(meshing.__all__) & set(hybrid_rt.__all__)
    assert set(meshing.__all__) - shared == {"CertifiedMesh", "tessellate"}
    for name in shared:
        assert getattr(hybrid_rt, name) is getattr(meshing, name)


@pytest.mark.parametrize("name", ["tessellate", "Sphree"])
def test_other_names_are_refused(name):
    with pytest.raises(AttributeError, match=f"module 'hybrid_rt' has no attribute '{name}'"):
        getattr(hybrid_rt, name)


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("Sphree", "did you mean 'Sphere'"),
        ("DirectionalLight", "SphereLight far away"),
        ("AreaLight", "RectangleLight"),
        ("Mesh", "TriangleMesh"),
        ("Diffuse", "Lambertian"),
    ],
)
def test_names_of_other_programs_are_answered(name, meant):
    with pytest.raises(AttributeError, match=meant):
        getattr(hybrid_rt, name)
    assert not hasattr(hybrid_rt, name)
    with pytest.raises(ImportError, match=meant):
        exec(f"from hybrid_rt import {name}")  # noqa: S102


def test_what_is_named_instead_is_there():
    """Words with a capital letter, but for those of arguments and other packages."""
    for name, meant in _BY_NAME.items():
        assert not any(public.lower() == name for public in hybrid_rt.__all__), name
        words = re.findall(
            r"\b[A-Z]\w+", meant.replace("trimesh.Trimesh", "").replace(" Object", " ")
        )
        for word in words:
            assert hasattr(hybrid_rt, word), (name, word)


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
