import numpy as np
import pytest

from hybrid_rt.sampling.sampler import MOST_JOINT, Sampler

N_PIXELS = 500


def points(pixels, dimension=3, pass_number=0, seed=11):
    return Sampler(seed).points(np.asarray(pixels, np.uint64), dimension, pass_number)


def sequence(n, pixel=5, dimension=3, seed=11):
    return np.concatenate([points([pixel], dimension, i, seed) for i in range(n)])


def test_any_split_into_blocks_gives_the_same_bits():
    whole = points(np.arange(N_PIXELS), pass_number=9)
    for size in (1, 7, 64):
        parts = [
            points(np.arange(i, min(i + size, N_PIXELS)), pass_number=9)
            for i in range(0, N_PIXELS, size)
        ]
        np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_bits_are_those_of_the_first_release():
    # Pictures are to be reproducible across versions: a change here is a change of all of them.
    np.testing.assert_array_equal(
        (points([0, 1, 2**40], pass_number=3, seed=2**63) * 2**32).astype(np.uint64),
        GOLDEN,
    )


@pytest.mark.parametrize("change", ["seed", "pixel", "dimension", "pass"])
def test_each_name_matters(change):
    changed = {
        "seed": points([5], seed=12),
        "pixel": points([6]),
        "dimension": points([5], dimension=4),
        "pass": points([5], pass_number=1),
    }
    assert (changed[change] != points([5])).all()


@pytest.mark.parametrize("pixel", range(8))
@pytest.mark.parametrize("k", [2, 4, 6, 8])
def test_every_power_of_two_of_passes_is_a_net(pixel, k):
    """In a (0, k, 2)-net each elementary rectangle of area 2**-k holds exactly one point."""
    xi = sequence(2**k, pixel)
    for i in range(k + 1):
        cell = (xi * (2**i, 2 ** (k - i))).astype(int)
        assert np.unique(cell[:, 0] * 2 ** (k - i) + cell[:, 1]).size == 2**k


def test_later_passes_fill_the_holes_of_the_earlier_ones():
    xi = sequence(64)
    for first in range(0, 64, 16):
        cell = (xi[first : first + 16] * 4).astype(int)
        assert np.unique(cell[:, 0] * 4 + cell[:, 1]).size == 16


def joint(number, pixel=5, dimension=3, seed=11, width=MOST_JOINT):
    number = np.asarray(number, np.uint64)
    return Sampler(seed).joint(np.full_like(number, pixel), dimension, number, width)


class TestJoint:
    def test_each_coordinate_has_one_point_in_each_interval(self):
        """The first 2**k points, and every aligned run of 2**k points, of each coordinate alone."""
        for first in (0, 3 * 256):
            cell = (joint(np.arange(first, first + 256)) * 256).astype(int)
            np.testing.assert_array_equal(
                np.sort(cell, axis=0), np.arange(256)[:, None].repeat(5, 1)
            )

    @pytest.mark.parametrize(("width", "quality"), [(2, 0), (3, 1), (4, 3), (5, 5)])
    def test_boxes_hold_their_share(self, width, quality):
        """(t, k, s)-nets: boxes of volume 2**(t - k) hold 2**t points, t as the literature has it.

        Sobol's sequences have t = sum of (degree - 1) of their polynomials: 0, 0, 1, 3, 5.
        """
        k = 10
        xi = joint(np.arange(2**k), width=width)
        n_bits = k - quality
        for split in np.ndindex(*(n_bits + 1,) * (width - 1)):
            bits = [*split, n_bits - sum(split)]
            if bits[-1] < 0:
                continue
            cell = np.zeros(2**k, dtype=int)
            for column, b in zip(xi.T, bits, strict=True):
                cell = cell * 2**b + (column * 2**b).astype(int)
            np.testing.assert_array_equal(np.bincount(cell, minlength=2**n_bits), 2**quality)

    @pytest.mark.parametrize("change", ["seed", "pixel", "dimension"])
    def test_each_name_matters(self, change):
        changed = joint([9], **{change: 12})
        assert (changed != joint([9])).all()

    def test_any_split_gives_the_same_bits_and_width_changes_none(self):
        whole = joint(np.arange(100))
        np.testing.assert_array_equal(joint(np.arange(40, 77)), whole[40:77])
        np.testing.assert_array_equal(joint(np.arange(100), width=2), whole[:, :2])


@pytest.mark.statistical
@pytest.mark.parametrize("pass_number", [0, 1, 17])
def test_points_of_different_pixels_are_uniform_and_independent(pass_number):
    """Chi-square over 16 x 16 cells; false alarm rate below 1e-6 (255 degrees of freedom)."""
    n = 2**16
    xi = points(np.arange(n), pass_number=pass_number)
    assert xi.min() >= 0
    assert xi.max() < 1
    counts = np.histogram2d(xi[:, 0], xi[:, 1], bins=16, range=[[0, 1], [0, 1]])[0]
    expected = n / 256
    assert ((counts - expected) ** 2 / expected).sum() < 380
    neighbours = np.histogram2d(xi[:-1, 0], xi[1:, 0], bins=16, range=[[0, 1], [0, 1]])[0]
    assert ((neighbours - expected) ** 2 / expected).sum() < 380


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_seeds_out_of_range_are_refused(seed):
    with pytest.raises(ValueError, match="seed"):
        Sampler(seed)


GOLDEN = [[1816302590, 2446661660], [1486140813, 847273586], [4137389818, 1447571403]]
