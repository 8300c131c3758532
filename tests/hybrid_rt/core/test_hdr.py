"""Radiance pictures, written here by the rules of the format."""

import math

import numpy as np
import pytest

from hybrid_rt import ImageEnvironment, ImageTexture
from hybrid_rt.core.hdr import read_hdr

HEADER = b"#?RADIANCE\n# made by hand\nFORMAT=32-bit_rle_rgbe\n"
RNG = np.random.default_rng(1)
# Mantissas and exponents; some pixels are black, some columns alike.
PIXELS = RNG.integers(0, 256, (5, 12, 4), dtype=np.uint8)
PIXELS[1, 3:10] = PIXELS[1, 3]
PIXELS[2, 4, 3] = 0
PIXELS[:, :, 3] = np.clip(PIXELS[:, :, 3], 100, 150) * (PIXELS[:, :, 3] > 0)
# No pixel begins as a coded scanline or is a run.
PIXELS[:, :, 0] |= 4
# mantissa / 256 x 2^(exponent - 128): all of it in float32 without rounding.
TRUTH = np.array(
    [
        [[math.ldexp(int(m), int(p[3]) - 136) * (p[3] > 0) for m in p[:3]] for p in row]
        for row in PIXELS
    ]
)


def flat(pixels):
    return pixels.tobytes()


def coded(pixels):
    """Components one after the other, as runs where three or more are alike."""
    out = b""
    for row in pixels:
        out += bytes((2, 2, len(row) >> 8, len(row) & 255))
        for values in row.T.tolist():
            i = 0
            while i < len(values):
                run = (
                    next((k for k in range(i, len(values)) if values[k] != values[i]), len(values))
                    - i
                )
                if run >= 3:
                    out += bytes((128 + run, values[i]))
                else:
                    run = min(run + 1, len(values) - i)
                    out += bytes((run, *values[i : i + run]))
                i += run
    return out


def coded_of_old(pixels):
    out = b""
    for row in pixels.tolist():
        before, n = None, 0
        for pixel in [*row, None]:
            if pixel == before:
                n += 1
                continue
            if n:
                out += bytes((1, 1, 1, n))
            out += b"" if pixel is None else bytes(pixel)
            before, n = pixel, 0
    return out


@pytest.mark.parametrize("write", [flat, coded, coded_of_old])
def test_pixels_are_read_as_they_were_written(write, tmp_path):
    file = tmp_path / "sky.hdr"
    file.write_bytes(HEADER + b"\n-Y 5 +X 12\n" + write(PIXELS))
    np.testing.assert_array_equal(read_hdr(file), TRUTH)
    np.testing.assert_array_equal(ImageTexture(file).texels, TRUTH)
    assert "12 x 5" in repr(ImageEnvironment(file))
    file.write_bytes(HEADER + b"EXPOSURE=2\nEXPOSURE= 4.0\n\n+Y 5 +X 12\n" + write(PIXELS))
    np.testing.assert_array_equal(read_hdr(file), TRUTH[::-1] / 8)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"no picture", "does not begin as a Radiance picture"),
        (HEADER.replace(b"rgbe", b"xyze") + b"\n-Y 1 +X 1\n1234", "it holds XYZ"),
        (HEADER + b"\n+X 5 +Y 12\n", "not as '-Y height"),
        (HEADER + b"\n-Y 5 +X 12\n" + flat(PIXELS)[:-1], "cut off"),
        (HEADER + b"\n-Y 5 +X 12\n" + coded(PIXELS)[:-1], "cut off"),
        (HEADER + b"\n-Y 1 +X 2\n" + bytes((9, 9, 9, 9, 1, 1, 1, 2)), "longer than its scanline"),
        (HEADER + b"\n-Y 1 +X 9\n" + bytes((2, 2, 0, 8, 137, 5)), "another width"),
        (HEADER + b"\n-Y 1 +X 9\n" + bytes((2, 2, 0, 9, 138, 5)), "longer than its scanline"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_said(data, words, tmp_path):
    (tmp_path / "sky.hdr").write_bytes(data)
    with pytest.raises(ValueError, match=words):
        ImageEnvironment(tmp_path / "sky.hdr")
