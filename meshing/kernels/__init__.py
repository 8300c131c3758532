"""Numba kernels of `meshing`: numbers and arrays in, numbers and arrays out, no objects."""

# First of all kernels, so that one sentence tells what hinders all of them.
try:
    import numba  # noqa: F401
except ValueError as error:  # numba reads its environment variables
    raise ImportError(
        f"numba cannot start ({error}): see the environment variables named NUMBA_..., "
        "NUMBA_NUM_THREADS must be from 1 on"
    ) from None
