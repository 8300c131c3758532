"""The whole of a render: passes, limits, a picture and its report."""

from hybrid_rt.rendering.renderer import RenderInterrupted, RenderResult, render

__all__ = ["RenderInterrupted", "RenderResult", "render"]
