"""Balls in double-double and the polynomials that filters solve by them."""
