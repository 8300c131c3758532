"""The assignment of pass numbers to groups; each group has random numbers of its own."""

import numpy as np
from numpy.typing import NDArray

UIntArray = NDArray[np.uint64]


# Passes are dealt out to groups, a run of RUN passes to each in turn, and every group has random
# numbers of its own. So errors taken from the differences between groups are honest, however evenly
# the passes within a group fill their domain; a run is a complete net, so few passes are as good as
# they can be. More groups would know their error better and make it larger: docs/error_vs_time.md
# says what four cost.
GROUPS, RUN = 4, 4


def group_of(pass_number: UIntArray) -> tuple[UIntArray, UIntArray]:
    """Return the group of each pass, and the pass's number in it."""
    run, place = np.divmod(pass_number, np.uint64(RUN))
    turn, group = np.divmod(run, np.uint64(GROUPS))
    return group, turn * np.uint64(RUN) + place


def pass_of(group: UIntArray, number: UIntArray) -> UIntArray:
    """Return the pass numbers: the inverse of `group_of`."""
    turn, place = np.divmod(number, np.uint64(RUN))
    return (turn * np.uint64(GROUPS) + group) * np.uint64(RUN) + place
