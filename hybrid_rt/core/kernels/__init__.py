"""Compiled arithmetic that several packages use."""
