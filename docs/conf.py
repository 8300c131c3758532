"""Settings of the site: ``python -m sphinx -W --keep-going docs site`` builds it."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(folder) for folder in (ROOT, ROOT / "tools", ROOT / "tests", HERE / "_ext")]

from hybrid_rt import __version__ as release

project = "hybrid_rt"
copyright = "the authors of hybrid_rt"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "numpydoc",
    "command_options",
    "public_names",
]
exclude_patterns = ["_ext", "_build"]
needs_sphinx = "8.2"

# Markdown as GitHub reads it: links to headings by GitHub's rule, tables, raw HTML left alone.
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath", "colon_fence"]

# `name` in a docstring links to what it names, where that is public.
default_role = "py:obj"
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "none"  # the docstrings say types, with shapes and units
numpydoc_show_class_members = False  # autodoc does, with their docstrings

smartquotes = False  # "--" is an option, not a dash

html_theme = "furo"
html_title = f"hybrid_rt {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_show_copyright = False
pygments_style = "friendly"
pygments_dark_style = "monokai"
