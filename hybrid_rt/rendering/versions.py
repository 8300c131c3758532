"""The environment of a render, for its report: versions."""

import platform
from functools import cache
from importlib import metadata

from hybrid_rt._version import __version__

# Whatever decides bits of a picture.
_PACKAGES = ("numpy", "numba", "scipy", "embreex", "trimesh")


def versions() -> dict[str, str]:
    """Return the versions of everything that can change a picture's bits."""
    return {
        "hybrid_rt": __version__,
        "python": platform.python_version(),
        **{name: _version_of(name) for name in _PACKAGES},
    }


@cache
def _version_of(package: str) -> str:
    # From its metadata, so nothing is imported for it; reading those takes milliseconds.
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
