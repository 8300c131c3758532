"""What kernels count while they search: the places in the tally, and their names in reports."""

# Places in the counters that kernels fill; see `COUNTER_NAMES`.
NODES, CELLS, NEWTONS, STEPS, SLOW, PIECES, GIVEN_UP, CHANGED, MOST_PIECES = range(9)
COUNTER_NAMES = (
    "nodes",
    "cells",
    "newton_solves",
    "newton_steps",
    "slow_solves",
    "slow_pieces",
    "given_up",
    "changed_by_certificate",
    "most_pieces",
)
