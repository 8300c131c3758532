"""Compiled steps of light transport, over batches of rays and photons."""
