"""Compiled BSDFs, emitter sampling, textures, medium stacks."""
