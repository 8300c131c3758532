"""The memory that this process can have."""

from __future__ import annotations

import os
from pathlib import Path

# Where a container may be given less than the machine has.
CONTAINER_LIMIT = Path("/sys/fs/cgroup/memory.max")


def available_bytes() -> int:
    """Return the memory available to this process, bytes."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        return min(total, int(CONTAINER_LIMIT.read_text()))
    except (OSError, ValueError):  # there is no such file, or it says "max"
        return total


def bytes_in_words(n_bytes: int) -> str:
    """Return a number of bytes as "1.5 GiB"."""
    n_gib, unit = n_bytes // 2**20 / 2**10, "GiB"
    for larger in ("TiB", "PiB", "EiB"):
        if n_gib < 1000.0:
            break
        n_gib, unit = n_gib / 2**10, larger
    return f"{n_gib:.3g} {unit}"
