"""A system that has not what Unix alone has, as Windows: it is taken away in a process of its own."""

import subprocess
import sys

TAKEN = """
import os, signal, sys
# What the libraries need of it they have found.
import concurrent.futures, logging, multiprocessing, random, subprocess, tempfile
import numba, numpy, scipy.special, imageio.v3
for name in ("fcntl", "resource", "termios", "pwd", "grp"):
    sys.modules[name] = None
for of, names in (
    (os, ("register_at_fork", "fchown", "fchmod", "geteuid", "getuid", "O_NOFOLLOW", "O_NONBLOCK")),
    (signal, ("pthread_sigmask", "SIGHUP", "SIGKILL")),
):
    for name in names:
        delattr(of, name)
"""
RENDER = """
import hybrid_rt as rt
from hybrid_rt.core.memory import available_bytes, free_descriptors, peak_memory_mib
assert (available_bytes(), free_descriptors(3), peak_memory_mib()) == (sys.maxsize, sys.maxsize, 0.0)
camera = rt.Camera((0, 0, 0), (0, 0, 1), (0, 1, 0), 40, 2, 2)
scene = rt.Scene(camera, [], environment=rt.GradientSky((1, 1, 1), (1, 1, 1)))
result = rt.render(scene, passes=2, store="kept")
result.save("picture.png")
assert (result.image == 1.0).all()
"""


def test_a_picture_is_rendered_stored_and_saved(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", TAKEN + RENDER],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "picture.png").stat().st_size > 0
