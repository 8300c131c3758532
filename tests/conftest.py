"""The cores are shared out to the processes that run tests."""

import os


def pytest_configure(config):
    """Give each of several processes cores of its own: threads of all on all cores take a fifth longer."""
    del config
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker is None or not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    share = len(cores) // int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
    if share:
        # One that takes the place of a crashed one has a number beyond the count.
        first = share * int(worker.removeprefix("gw")) % len(cores)
        os.sched_setaffinity(0, cores[first : first + share])
