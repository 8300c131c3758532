"""The one decorator of every kernel, and where compiled kernels are cached.

A kernel compiles once per machine: numba keeps the machine code beside the source or, where that
folder cannot be written, in the user's cache folder. Where neither can be written it would refuse
to compile at all; a folder for temporary files then takes their place.
"""

import os
import tempfile
from pathlib import Path
from typing import Any


def _can_write(folder: Path) -> bool:
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return os.access(folder, os.W_OK)


def _choose_cache_folder() -> None:
    beside_source = Path(__file__).parent
    of_user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    if "NUMBA_CACHE_DIR" in os.environ or _can_write(beside_source) or _can_write(of_user):
        return
    name = f"hybrid_rt-kernels-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
    os.environ["NUMBA_CACHE_DIR"] = str(Path(tempfile.gettempdir()) / name)


_choose_cache_folder()

import numba


def kernel(function: Any) -> Any:
    """Compile a function for scalars and arrays: no GIL, cached, divisions as in NumPy."""
    return numba.njit(cache=True, nogil=True, error_model="numpy")(function)


_WITHOUT_ALLOCATION: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}


def hot_kernel(function: Any) -> Any:
    """Compile an entry point that allocates nothing; its scratch is passed in.

    numba counts references of every array that is handed on, atomically, and its optimiser removes
    only part of that. Without its memory manager there is nothing to count: a ray and a rectangle
    take 80 ns instead of 440.
    """
    return numba.njit(cache=True, **_WITHOUT_ALLOCATION)(function)


def inner(function: Any) -> Any:
    """Compile a function that only kernels call: no allocation, kept in its callers' cache."""
    return numba.njit(**_WITHOUT_ALLOCATION)(function)


def inlined(function: Any) -> Any:
    """As `inner`, but always compiled into its callers.

    An array is handed on as seven numbers or more, so calling a function with a table of ten
    arrays costs about 80 ns: for a few dozen operations per ray and surface, most of the time.
    """
    return numba.njit(forceinline=True, **_WITHOUT_ALLOCATION)(function)
