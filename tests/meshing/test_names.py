"""The package's names mean the same whatever was imported before."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    "line",
    [
        "from meshing import CertifiedMesh, tessellate",
        "from meshing import *",
        "import meshing.tessellation; from meshing import tessellate",
    ],
)
def test_tessellate_is_the_function(line):
    subprocess.run([sys.executable, "-c", f"{line}\nassert callable(tessellate)"], check=True)
