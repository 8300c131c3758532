"""Photons as probes: what other integrators do not find, and a mean to hold pictures against."""
