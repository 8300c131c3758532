"""The scene: `Scene` as described, `CompiledScene` as flat tables, and the plan of its features."""
