"""Double-double arithmetic: numbers as unevaluated sums of two float64, about 32 digits.

Dekker, "A floating-point technique for extending the available precision", Numer. Math. 18, 1971;
Knuth's two-sum. Every function takes and returns (high, low) pairs, |low| <= ulp(high) / 2. The
products split their factors, so numbers up to 1e150 in size are safe.
"""

import math

from meshing.kernels.jit import inner

SPLITTER = 134217729.0  # 2**27 + 1


@inner
def two_sum(a, b):
    """Add exactly: a + b."""
    s = a + b
    z = s - a
    return s, (a - (s - z)) + (b - z)


@inner
def quick_two_sum(a, b):
    """Add exactly: a + b, for |a| >= |b| or a = 0."""
    s = a + b
    return s, b - (s - a)


@inner
def two_product(a, b):
    """Multiply exactly: a b."""
    p = a * b
    c = SPLITTER * a
    ah = c - (c - a)
    al = a - ah
    c = SPLITTER * b
    bh = c - (c - b)
    bl = b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@inner
def add(ah, al, bh, bl):
    """Add: relative error about 2**-105, also where the two cancel."""
    s, e = two_sum(ah, bh)
    f, g = two_sum(al, bl)
    s, e = quick_two_sum(s, e + f)
    return quick_two_sum(s, e + g)


@inner
def subtract(ah, al, bh, bl):
    """Subtract b from a."""
    return add(ah, al, -bh, -bl)


@inner
def multiply(ah, al, bh, bl):
    """Multiply: relative error about 2**-102."""
    p, e = two_product(ah, bh)
    return quick_two_sum(p, e + (ah * bl + al * bh))


@inner
def divide(ah, al, bh, bl):
    """Divide a by b: two corrections of the float64 quotient."""
    q = ah / bh
    ph, pl = multiply(q, 0.0, bh, bl)
    rh, rl = subtract(ah, al, ph, pl)
    r = rh / bh
    ph, pl = multiply(r, 0.0, bh, bl)
    rh, rl = subtract(rh, rl, ph, pl)
    q, e = quick_two_sum(q, r)
    return add(q, e, rh / bh, 0.0)


@inner
def root(ah, al):
    """Square root; 0 for what is not positive (Karp's correction)."""
    if ah <= 0.0:
        return 0.0, 0.0
    x = 1.0 / math.sqrt(ah)
    y = ah * x
    ph, pl = two_product(y, y)
    rh, _ = subtract(ah, al, ph, pl)
    s, e = quick_two_sum(y, rh * (x * 0.5))
    # Once more: the first correction starts from a rounded reciprocal.
    ph, pl = multiply(s, e, s, e)
    rh, _ = subtract(ah, al, ph, pl)
    return add(s, e, rh * (x * 0.5), 0.0)


@inner
def interpolate(ah, al, bh, bl, uh, ul):
    """Return a + u (b - a)."""
    dh, dl = subtract(bh, bl, ah, al)
    dh, dl = multiply(dh, dl, uh, ul)
    return add(ah, al, dh, dl)
