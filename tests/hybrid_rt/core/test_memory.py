"""Memory that limits of the process and of its groups leave."""

import resource

import pytest

from hybrid_rt import Camera, Scene, render
from hybrid_rt.core import memory
from hybrid_rt.core.memory import available_bytes

PAGE = resource.getpagesize()
NONE = resource.RLIM_INFINITY


@pytest.fixture
def limits(monkeypatch, tmp_path):
    """Limits of the process that a test sets; 300 pages are mapped, 50 of them data."""
    (tmp_path / "statm").write_text("300 100 20 5 0 50 0\n")
    found = {resource.RLIMIT_AS: NONE, resource.RLIMIT_DATA: NONE}
    monkeypatch.setattr(memory.resource, "getrlimit", lambda which: (found[which], NONE))
    monkeypatch.setattr(memory, "USED_PAGES", tmp_path / "statm")
    monkeypatch.setattr(memory, "OWN_GROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(memory, "GROUPS", tmp_path / "groups")
    return found


def test_limits_of_the_process_count_without_what_it_uses(limits):
    """As ``ulimit -v`` and ``ulimit -d`` set them."""
    whole = available_bytes()
    limits[resource.RLIMIT_DATA] = 1000 * PAGE
    assert available_bytes() == 950 * PAGE
    limits[resource.RLIMIT_AS] = 1000 * PAGE
    assert available_bytes() == 700 * PAGE
    limits[resource.RLIMIT_AS] = 100 * PAGE
    assert available_bytes() == 0
    limits.update(dict.fromkeys(limits, NONE))
    assert available_bytes() == whole > 1000 * PAGE


@pytest.mark.parametrize(
    ("own", "files", "expected"),
    [
        ("0::/a/b\n", {"a/b/memory.max": "5000"}, 5000),
        ("0::/a/b\n", {"a/memory.max": "4000", "a/b/memory.max": "max"}, 4000),
        ("0::/a/b\n", {"a/memory.max": "4000", "a/b/memory.max": "3000"}, 3000),
        ("0::/\n", {"memory.max": "2000"}, 2000),
        # A container that sees its group as the root, and its path from outside.
        ("0::/seen/from/outside\n", {"memory.max": "1000"}, 1000),
        ("3:cpu:/x\n2:memory:/x\n0::/\n", {"memory/x/memory.limit_in_bytes": "900"}, 900),
        ("2:cpu,memory:/x\n", {"memory/memory.limit_in_bytes": "800"}, 800),
    ],
)
def test_limits_of_groups_count_and_of_those_that_they_are_in(
    limits, tmp_path, own, files, expected
):
    del limits
    (tmp_path / "cgroup").write_text(own)
    for name, content in files.items():
        file = tmp_path / "groups" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content + "\n")
    assert available_bytes() == expected


def test_a_picture_beyond_ulimit_is_refused_before_any_work(limits):
    """175 bytes a pixel."""
    limits[resource.RLIMIT_AS] = 2**30
    scene = Scene(Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=4000, height=3000))
    with pytest.raises(
        MemoryError, match=r"takes about 1.96 GiB of memory, this process can have 0.99"
    ):
        render(scene, passes=1)
