"""The decorators of kernels: what numba compiles, and how."""

from functools import partial
from typing import Any

import numba
from numba.core import registry, types

from meshing.kernels.cache import CacheOfParts, SharedCache
from meshing.kernels.link_only import OUTLINED, LinkOnly

CPUDispatcher: Any = registry.CPUDispatcher

# numba makes two more entries of each function: one for Python, and one for C, which nobody calls.
_COMMON: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_WITHOUT_ALLOCATION: dict[str, Any] = {**_COMMON, "_nrt": False}


def kernel(function: Any = None, *, allocates: bool = False) -> Any:
    """Compile an entry point for scalars and arrays: no GIL, cached, divisions as in NumPy.

    Its scratch memory is passed in, unless it is said to allocate: numba counts the references to every
    array passed to a function, atomically, and its optimiser removes only some of that. Without numba's
    runtime nothing is counted: intersecting a ray with a rectangle takes 80 ns instead of 440.
    """
    if function is None:
        return partial(kernel, allocates=allocates)
    return _cached(numba.njit(**(_COMMON if allocates else _WITHOUT_ALLOCATION))(function))


def inner(function: Any = None, *, outlined: bool = False) -> Any:
    """Compile a function that only kernels call: no allocation, kept in its callers' cache.

    It is inlined where its caller is, as numba hands that option down; ``outlined`` never. That is for
    what few rays need. A kernel with many copies of such code in it takes long to compile: the one of
    trimmed aspheres took 150 s, and takes 22 s with one call of each.
    """
    if function is None:
        return partial(inner, outlined=outlined)
    if not outlined:
        return _for_kernels(function)
    setattr(function, OUTLINED, True)
    return _for_kernels(function, forceinline=False)


def inlined(function: Any = None, *, cached: bool = False) -> Any:
    """As `inner`, but always inlined.

    An array is passed as seven numbers or more, so calling a function with a table of ten arrays
    costs about 80 ns: most of the time of a function with a few dozen operations.

    What takes a second or more to compile is ``cached``, by itself. Kernels that call it link what has
    been compiled once, and while the cache is cold, several processes compile the parts of one kernel.
    The machine code of the kernels is the same. (Not so of functions that are not always inlined:
    linked from a cache they never are.)
    """
    if function is None:
        return partial(inlined, cached=cached)
    compiled = _for_kernels(function, forceinline=True)
    return _cached(compiled, CacheOfParts) if cached else compiled


def _cached(compiled: Any, cache: type[SharedCache] = SharedCache) -> Any:
    if isinstance(compiled, CPUDispatcher):  # not so under NUMBA_DISABLE_JIT
        compiled._cache = cache(compiled.py_func)
    return compiled


class _ForKernels(CPUDispatcher):  # type: ignore[misc]
    """A function compiled without machine code of its own, nor an entry for Python."""

    _for_python: Any = None

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compile it once, and not for each constant that it is called with.

        The optimiser sees the constants all the same, as it inlines.
        """
        return super().get_call_template(tuple(map(types.unliteral, args)), kws)

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python all the same, by a compilation of its own, as tests do."""
        if self._for_python is None:
            self._for_python = numba.njit(**_WITHOUT_ALLOCATION)(self.py_func)
        return self._for_python(*arguments)


def _for_kernels(function: Any, **options: Any) -> Any:
    options |= {**_WITHOUT_ALLOCATION, "no_cpython_wrapper": True, "pipeline_class": LinkOnly}
    compiled: Any = numba.njit(**options)(function)
    if isinstance(compiled, CPUDispatcher):
        compiled.__class__ = _ForKernels
    return compiled
