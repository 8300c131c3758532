"""Compiled loops of competing methods."""
