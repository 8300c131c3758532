"""Arithmetic of the judges that kernels use too."""
