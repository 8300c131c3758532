"""Whitted ray tracing: direct light, mirrors, both branches at glass."""
