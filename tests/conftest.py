"""On a cold cache all cores compile the kernels that the whole suite needs; then they are shared out."""

import os

import pytest

from hybrid_rt.core import precompile


def pytest_configure(config):
    _share_cores()
    if config.args_source is not pytest.Config.ArgsSource.TESTPATHS:
        return
    groups = {group for entry in precompile.read_list() for group in entry.groups}
    precompile.want(*groups)
    # Several processes would each compile everything, so they start when it is done.
    if getattr(config.option, "numprocesses", None):
        precompile.fill_cold_cache()


def _share_cores():
    """Give each of several processes cores of its own: threads of all on all cores take a fifth longer."""
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker is None or not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    share = len(cores) // int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
    if share:
        first = share * int(worker.removeprefix("gw"))
        os.sched_setaffinity(0, cores[first : first + share])
