"""Fingerprints of objects: equal for equal contents, whatever process makes them."""

import copyreg
import dis
import hashlib
import importlib
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from types import (
    BuiltinFunctionType,
    CodeType,
    FunctionType,
    GetSetDescriptorType,
    MemberDescriptorType,
    ModuleType,
)
from typing import Any

import numpy as np

# Digits of a fingerprint: that two of a thousand scenes share one has a chance of 1e-13.
DIGITS = 16
# Packages whose versions a store compares by itself.
_KNOWN = {"hybrid_rt", "meshing", "numpy", "numba", "scipy", "embreex", "trimesh"}
# Attributes of classes that say nothing of what they do, or only what others say as well.
_ABOUT = {
    "__dict__", "__weakref__", "__doc__", "__module__", "__annotations__", "__firstlineno__",
    "__static_attributes__", "__annotate_func__", "__annotations_cache__", "__annotate__",
    "_abc_impl", "__dataclass_fields__", "__dataclass_params__",
}  # fmt: skip


def fingerprint(value: Any) -> str:
    """Return 16 hexadecimal digits that name the contents of an object.

    Arrays count by dtype, shape and bytes; objects by their class and what pickle would keep of
    them, without `functools.cached_property`; functions by name and compiled code, so a comment is
    none of their contents. Classes and functions of the user's own count with all that they refer
    to: the globals that they name, base classes, what they use of modules of the user's own. Of
    installed packages the file counts; of Python, of this package and of those below it the name,
    as their versions are compared otherwise.

    Raises TypeError for objects that pickle refuses as well, such as open files; also if functions
    name them.
    """
    digest = _Digest()
    _add(value, digest, ())
    for code in digest.referred:  # which grows
        if isinstance(code, type):
            _add_class(code, digest)
        else:
            _add(code, digest, ())
    return digest.hash.hexdigest()[:DIGITS]


class _Digest:
    """A hash of contents, and the classes and functions that they refer to, each of them once."""

    def __init__(self) -> None:
        self.hash = hashlib.sha256()
        self.referred: list[Any] = []
        self._numbers: dict[int, int] = {}

    def update(self, content: bytes) -> None:
        self.hash.update(content)

    def refer(self, code: Any) -> None:
        number = self._numbers.setdefault(id(code), len(self.referred))
        if number == len(self.referred):
            self.referred.append(code)
        self.update(b"<code %d>" % number)


def _add(value: Any, digest: _Digest, around: tuple[int, ...]) -> None:
    """Add an object's contents; ``around`` holds the ids of the objects that it is a part of."""
    if id(value) in around:
        digest.update(b"<itself %d>" % around[::-1].index(id(value)))
        return
    inside = (*around, id(value))
    _add_type(type(value), digest)
    if isinstance(value, type):
        _add_type(value, digest)
    elif value is None or isinstance(value, bool | int | str | np.generic):
        digest.update(repr(value).encode())
    elif isinstance(value, float | complex):
        digest.update(repr(value).encode())  # all digits, and the sign of zero
    elif isinstance(value, bytes | bytearray):
        digest.update(bytes(value))
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode())
        if value.dtype.hasobject:
            for item in value.ravel().tolist():
                _add(item, digest, inside)
        else:
            digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, tuple | list):
        for item in value:
            _add(item, digest, inside)
    elif isinstance(value, set | frozenset):
        for name in sorted(fingerprint(item) for item in value):
            digest.update(name.encode())
    elif isinstance(value, Mapping):
        for key, item in value.items():
            _add(key, digest, inside)
            _add(item, digest, inside)
    elif isinstance(value, FunctionType):
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        defaults = (value.__defaults__, value.__kwdefaults__)
        for part in (value.__qualname__, value.__code__, defaults, cells):
            _add(part, digest, inside)
        _add_globals(value, digest, inside)
    elif isinstance(value, CodeType):  # of functions and comprehensions within it as well
        _add((value.co_code, value.co_names, value.co_consts), digest, inside)
    elif isinstance(value, BuiltinFunctionType):
        digest.update(f"{value.__module__}.{value.__qualname__}".encode())
    elif isinstance(value, ModuleType | MemberDescriptorType | GetSetDescriptorType):
        digest.update(value.__name__.encode())
    elif isinstance(value, property):
        _add((value.fget, value.fset), digest, inside)
    elif (wrapped := _wrapped(value)) is not None:
        _add((wrapped, getattr(value, "targetoptions", None)), digest, inside)
    else:
        for part in _kept(value):
            _add(part, digest, inside)
    digest.update(b"</>")


def _wrapped(value: Any) -> Any:
    """Return the function behind a kernel, a cache or a kind of method; None if there is none."""
    # A method of an object has one as well, but counts as pickle has it: with the object.
    is_of_class = isinstance(value, staticmethod | classmethod | cached_property)
    names = ("__func__", "func") if is_of_class else ("py_func", "__wrapped__")
    found = (getattr(value, name, None) for name in names)
    return next((one for one in found if isinstance(one, FunctionType)), None)


def _add_type(kind: type, digest: _Digest) -> None:
    """Add a class: by name, and one of the user's own by what it does as well."""
    if _is_own(kind.__module__):
        # Without its module: a script is __main__ or has its name, as it is run.
        digest.update(f"<{kind.__qualname__}>".encode())
        digest.refer(kind)
    else:
        digest.update(f"<{kind.__module__}.{kind.__qualname__}>".encode())
        digest.update(_file_of(kind.__module__))


def _add_class(kind: type, digest: _Digest) -> None:
    """Add base classes and attributes of a class of the user's own."""
    for base in kind.__bases__:
        _add_type(base, digest)
    for name, found in sorted(vars(kind).items()):
        if name not in _ABOUT:
            _add_used(name, found, f"class {kind.__qualname__}", (), digest, (id(kind),))


def _add_globals(value: FunctionType, digest: _Digest, around: tuple[int, ...]) -> None:
    """Add what a function of the user's own refers to by names beyond it."""
    if not _is_own(value.__module__):
        digest.update(_file_of(value.__module__))
        return
    for code in _codes(value.__code__):
        for step in dis.get_instructions(code):
            found = None
            if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
                found = value.__globals__.get(step.argval)
            elif step.opname == "IMPORT_NAME":
                with suppress(Exception):  # as it will when the function is called
                    found = importlib.import_module(step.argval)
            if found is not None:
                user = f"function {value.__qualname__}"
                _add_used(step.argval, found, user, code.co_names, digest, around)


def _add_used(
    name: str,
    found: Any,
    user: str,
    names: tuple[str, ...],
    digest: _Digest,
    around: tuple[int, ...],
) -> None:
    """Add what a name means, for who uses it; of a module of the user's own, what has these names."""
    digest.update(name.encode())
    if isinstance(found, FunctionType) and names:
        digest.refer(found)
    elif isinstance(found, ModuleType):
        digest.update(found.__name__.encode() + _file_of(found.__name__))
        if _is_own(found.__name__) and id(found) not in around:
            inside = (*around, id(found))
            for part in sorted({*names} & vars(found).keys()):
                _add_used(part, vars(found)[part], user, names, digest, inside)
    else:
        try:
            _add(found, digest, around)
        except _UnknownError:
            raise
        except Exception as error:  # noqa: BLE001  # whatever pickle may raise
            raise _UnknownError(
                f"{user} uses {name}, a {type(found).__name__}, which cannot be compared ({error})"
            ) from None


class _UnknownError(TypeError):
    """The contents of something cannot be told; the message names it and who uses it."""


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield code, and that of the functions and comprehensions within it."""
    yield code
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _codes(part)


def _is_own(module: str | None) -> bool:
    """Tell whether a module is neither known nor installed."""
    return not _is_known(module) and not _file_of(module)


@cache
def _is_known(module: str | None) -> bool:
    """Tell whether a module is Python's, or of a package whose version is compared otherwise."""
    top = (module or "").partition(".")[0]
    if top not in sys.stdlib_module_names or top not in sys.modules:
        return top in _KNOWN
    file = getattr(sys.modules[top], "__file__", None)  # not a test.py beside a script, say
    return file is None or Path(sysconfig.get_path("stdlib")) in Path(file).parents


@cache
def _file_of(module: str | None) -> bytes:
    """Return a hash of the file of an installed module; nothing of one that is known, or no such."""
    file = getattr(sys.modules.get(module or ""), "__file__", None)
    # What is called __main__ is the user's, also where an installed program runs it.
    if file is None or module == "__main__" or _is_known(module):
        return b""
    places = {Path(sysconfig.get_path(name)) for name in ("purelib", "platlib")}
    if places.isdisjoint(Path(file).parents):
        return b""
    return hashlib.sha256(Path(file).read_bytes()).digest()


def _kept(value: Any) -> tuple[Any, ...]:
    """Return what pickle would keep of an object."""
    registered = copyreg.dispatch_table.get(type(value))
    kept = value.__reduce_ex__(4) if registered is None else registered(value)
    if isinstance(kept, str):  # a global of its module, by name
        return kept, type(value).__module__
    make, *parts = kept
    if make is copyreg.__newobj__:  # type: ignore[attr-defined]
        make = type(value)
    arguments, state, *items = (*parts, None, None, None)[:4]
    if isinstance(state, dict):
        cached = {
            name
            for base in type(value).__mro__
            for name, found in vars(base).items()
            if isinstance(found, cached_property)
        }
        state = {name: item for name, item in state.items() if name not in cached}
    several = tuple(tuple(one) for one in items if one is not None)
    return make, arguments, state, several
