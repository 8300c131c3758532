"""Rivals, timings and calibrations that the tools run."""
