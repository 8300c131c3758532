"""What rounding may decide: the band around a ray, and eight rays on its rim."""

# A crossing is doubtful where moving the ray by this many times its scale could make or lose it.
BAND = 64.0 * 2.0**-52
# Rays moved by a little more, so that nothing on the rim of the band counts as certain.
SHIFT = 1.3
# Flatter than this rounding of the ray's own direction leaves nothing of a crossing's t.
LEAST_COSINE = 1e-16
# Cosines and sines of eight directions around the ray.
AROUND = (
    (1.0, 0.0),
    (0.7071067811865476, 0.7071067811865476),
    (0.0, 1.0),
    (-0.7071067811865476, 0.7071067811865476),
    (-1.0, 0.0),
    (-0.7071067811865476, -0.7071067811865476),
    (0.0, -1.0),
    (0.7071067811865476, -0.7071067811865476),
)
