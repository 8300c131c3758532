"""The command ``hybrid-rt``."""

from hybrid_rt.cli.program import main, render_script

__all__ = ["main", "render_script"]
