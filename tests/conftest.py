"""The whole suite needs nearly all kernels: on a cold cache all cores compile them."""

import pytest

from hybrid_rt.core import precompile


def pytest_configure(config):
    if config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        groups = {group for entry in precompile.read_list() for group in entry.groups}
        precompile.want(*groups)
