"""What the reference needs beyond autodoc.

Docstrings write absolute values as |x|, which reStructuredText would take for a substitution. And once
all pages are read, every public name must be on one.

A name of ``hybrid_rt.__all__`` or ``meshing.__all__`` that no page documents is a warning, which the
strict build makes an error. So is one without a docstring. What `hybrid_rt` takes over from `meshing` is
documented there.

What the tracer and the integrators ask of surfaces, materials and lights is on no page but that of
`Surface`, for those who add one.
"""

from __future__ import annotations

import importlib
import inspect
import re

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util import logging

MODULES = ("hybrid_rt", "meshing")
INNER = frozenset((
    "area_sampler", "ball", "ball_radius", "blur_stays", "carrier", "count_single_rays",
    "direction_pdf", "error_power", "exact_normal", "film_lock", "flip_of_uv", "frame",
    "is_freeform", "is_triangular", "joined_spans", "lobes", "local_exponent", "local_zones",
    "meet", "middle", "pieces", "poles", "reach", "revolution_frame", "rounding_reach", "row",
    "sides", "single_rays", "spans", "starts", "surface", "table", "without_light_paths",
))  # fmt: skip
LOG = logging.getLogger(__name__)


def escape_bars(
    _app: Sphinx, _what: str, _name: str, _of: object, _o: object, lines: list[str]
) -> None:
    """Escape bars outside ``literals``, in place."""
    for i, line in enumerate(lines):
        parts = re.split("(``.*?``)", line)
        parts[::2] = [part.replace("|", "\\|") for part in parts[::2]]
        lines[i] = "".join(parts)


def leave_out(
    _app: Sphinx, _what: str, name: str, member: object, _skip: bool, _o: object
) -> bool | None:
    """Return whether a member is left out of the pages; None: as autodoc decides."""
    owner = getattr(getattr(member, "fget", member), "__qualname__", "")
    return True if name in INNER and not owner.startswith("Surface.") else None


def check(_: Sphinx, env: BuildEnvironment) -> None:
    """Warn of public names that are missing."""
    documented = env.domains["py"].objects  # type: ignore[attr-defined]
    for module_name in MODULES:
        module = importlib.import_module(module_name)
        for name in module.__all__:
            if name.startswith("__"):
                continue
            value = getattr(module, name)
            home = getattr(value, "__module__", module_name).partition(".")[0]
            if f"{home}.{name}" not in documented:
                LOG.warning("no page of docs/reference has %s.%s: add it", module_name, name)
            if not inspect.getdoc(value):
                LOG.warning("%s.%s has no docstring", module_name, name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect them."""
    # Before numpydoc, which takes the sections apart at 500.
    app.connect("autodoc-process-docstring", escape_bars, priority=400)
    app.connect("autodoc-skip-member", leave_out)
    app.connect("env-check-consistency", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
