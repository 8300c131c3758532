"""Compiled bisection of control nets for the exact crossings."""
