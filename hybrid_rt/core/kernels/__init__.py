"""Compiled arithmetic that several rooms use."""
