"""Random numbers: each is named by seed, pixel, pass and use."""
