"""Faults of a scene that are found before anything is rendered, each in a file of its own."""
