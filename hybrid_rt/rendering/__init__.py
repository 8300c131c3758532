"""The render loop (`renderer`): passes, stopping criteria, output channels, the report.

Passes are summed, and their noise is estimated, in `hybrid_rt.sensor.film`.
"""
