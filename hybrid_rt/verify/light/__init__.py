"""An independent light tracer."""
