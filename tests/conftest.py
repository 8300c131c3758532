"""The whole suite needs nearly all kernels: on a cold cache all cores compile them."""

import pytest

from hybrid_rt.core import precompile


def pytest_configure(config):
    if config.args_source is not pytest.Config.ArgsSource.TESTPATHS:
        return
    groups = {group for entry in precompile.read_list() for group in entry.groups}
    precompile.want(*groups)
    # Several processes would each compile everything, so they start when it is done.
    if getattr(config.option, "numprocesses", None):
        precompile.fill_cold_cache()
