"""The command ``hybrid-rt``."""

from hybrid_rt.cli.main import main, render_script

__all__ = ["main", "render_script"]
