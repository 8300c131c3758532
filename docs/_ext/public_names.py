"""What the reference needs beyond autodoc.

Docstrings write absolute values as |x|, which reStructuredText would take for a substitution. And once
all pages are read, every public name must be on one.

A name of ``hybrid_rt.__all__`` or ``meshing.__all__`` that no page documents is a warning, which the
strict build makes an error. So is one without a docstring.
"""

from __future__ import annotations

import importlib
import inspect
import re

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util import logging

MODULES = ("hybrid_rt", "meshing")
LOG = logging.getLogger(__name__)


def escape_bars(
    _app: Sphinx, _what: str, _name: str, _of: object, _o: object, lines: list[str]
) -> None:
    """Escape bars outside ``literals``, in place."""
    for i, line in enumerate(lines):
        parts = re.split("(``.*?``)", line)
        parts[::2] = [part.replace("|", "\\|") for part in parts[::2]]
        lines[i] = "".join(parts)


def check(_: Sphinx, env: BuildEnvironment) -> None:
    """Warn of public names that are missing."""
    documented = env.domains["py"].objects  # type: ignore[attr-defined]
    for module_name in MODULES:
        module = importlib.import_module(module_name)
        for name in module.__all__:
            if name.startswith("__"):
                continue
            if f"{module_name}.{name}" not in documented:
                LOG.warning("no page of docs/reference has %s.%s: add it", module_name, name)
            if not inspect.getdoc(getattr(module, name)):
                LOG.warning("%s.%s has no docstring", module_name, name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect both."""
    # Before numpydoc, which takes the sections apart at 500.
    app.connect("autodoc-process-docstring", escape_bars, priority=400)
    app.connect("env-check-consistency", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
