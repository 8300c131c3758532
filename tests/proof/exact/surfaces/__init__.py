"""Exact crossings with each class of surfaces, one module a class or a few alike."""
