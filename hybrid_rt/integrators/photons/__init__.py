"""Photon mapping: photon tracing, density estimation, ppm and photon_map."""
