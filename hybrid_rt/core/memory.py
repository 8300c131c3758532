"""The memory that this process can have."""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

# Where a container, a batch system or a service may be given less than the machine has: control groups
# of version 2, and the memory controller of version 1. The limits of the groups that one is in hold as well.
OWN_GROUPS, GROUPS = Path("/proc/self/cgroup"), Path("/sys/fs/cgroup")
GROUP_LIMITS = {"": "memory.max", "memory": "memory.limit_in_bytes"}
# Limits of a process (``ulimit -v``, ``-d``), and the place in this file of the pages that count so far.
USED_PAGES = Path("/proc/self/statm")
PROCESS_LIMITS = {"RLIMIT_AS": 0, "RLIMIT_DATA": 5}


def available_bytes() -> int:
    """Return the memory available to this process, bytes; without end where the system does not tell."""
    if resource is None:
        return sys.maxsize
    page = os.sysconf("SC_PAGE_SIZE")
    limits = [page * os.sysconf("SC_PHYS_PAGES"), *_limits_of_groups()]
    for which, place in PROCESS_LIMITS.items():
        limit = resource.getrlimit(getattr(resource, which))[0]
        if limit != resource.RLIM_INFINITY:
            with suppress(OSError):  # not on this system: all of it is left
                limit -= page * int(USED_PAGES.read_text().split()[place])
            limits.append(max(limit, 0))
    return min(limits)


def peak_memory_mib() -> float:
    """Return the peak memory of this process, MiB; 0 where the system does not tell."""
    if resource is None:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Kibibytes, but bytes on a Mac.
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


def free_descriptors(lowest: int) -> int:
    """Return how many files this process may still open, at most, if ``lowest`` is what it got now."""
    if resource is None:
        return sys.maxsize
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    # The lowest free descriptor is given out: all below it are in use.
    return sys.maxsize if limit == resource.RLIM_INFINITY else limit - 1 - lowest


def _limits_of_groups() -> Iterator[int]:
    """Yield the limits of the control groups that this process is in, from the root down."""
    with suppress(OSError):
        for line in OWN_GROUPS.read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            for controller in controllers.split(","):
                if controller not in GROUP_LIMITS:
                    continue
                # A container may see its own group as the root, by another path than the file says.
                folder = GROUPS / controller
                for part in ("", *path.strip("/").split("/")):
                    folder /= part
                    with suppress(OSError, ValueError):  # no such group here, or the word "max"
                        yield int((folder / GROUP_LIMITS[controller]).read_text())


def bytes_in_words(n_bytes: int) -> str:
    """Return a number of bytes as "1.5 GiB"."""
    n_gib, unit = n_bytes // 2**20 / 2**10, "GiB"
    for larger in ("TiB", "PiB", "EiB"):
        if n_gib < 1000.0:
            break
        n_gib, unit = n_gib / 2**10, larger
    return f"{n_gib:.3g} {unit}"
