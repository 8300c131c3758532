"""The kinds of lobes: a register of them, and the value, density and sample of each."""
