"""Independent oracles of first hits, and what counts as wrong."""
