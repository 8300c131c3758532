"""The kinds of lobes: a register, and eval, pdf and sample of each."""
