"""Competing methods, timings and calibrations, run by the tools."""
