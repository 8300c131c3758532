"""Rays against Bezier patches: cells, Newton's iteration, certificate, subdivision."""
