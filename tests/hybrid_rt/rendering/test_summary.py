import pytest

from hybrid_rt.rendering.summary import per_cent


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0 %"),
        (0.00123, "0.12 %"),
        (0.345, "34 %"),
        (0.994, "99 %"),
        (0.996, "100 %"),
        (1.9, "190 %"),
        (123.4, "12,000 %"),
        (1e9, "1e+11 %"),
        (float("nan"), "nan %"),
    ],
)
def test_two_digits_of_a_share(share, text):
    assert per_cent(share) == text
