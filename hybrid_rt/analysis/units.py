"""Numbers in words: seconds, shares and counts as one says them aloud."""

import math

# From here on seconds are told as minutes, and minutes as hours.
MINUTES, HOURS = 120.0, 7200.0


def number(value: float, digits: int = 3) -> str:
    """Return a number with so many digits, without an exponent where it is readable without."""
    if not math.isfinite(value):
        return "unknown"
    if value == 0.0:
        return "0"
    if 1e-4 <= abs(value) < 1e9:
        places = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
        rounded = round(value, digits - 1 - math.floor(math.log10(abs(value))))
        return f"{rounded:,.{places}f}"
    return f"{value:.{digits - 1}e}"


def percent(share: float, digits: int = 2) -> str:
    """Return a share as "1.1 %"."""
    return f"{number(100.0 * share, digits)} %" if math.isfinite(share) else "unknown"


def asked(share: float) -> str:
    """Return a share that was asked for, exactly, as "1 %"."""
    return f"{100.0 * share:.6g} %"


def of_pixels(trimmed: bool) -> str:
    """Return what is said behind an error that leaves out the worst pixels."""
    return " without the worst 0.1 % of the pixels" if trimmed else ""


def signed_percent(share: float, digits: int = 2) -> str:
    """Return a share with its sign, as "+1.1 %"."""
    return ("+" if share > 0.0 else "") + percent(share, digits)


def seconds(value: float) -> str:
    """Return a time as "34 s", "5.2 min" or "1.5 h"."""
    if math.isinf(value):
        return "unknown"
    if not value >= MINUTES:
        return f"{number(value, 2)} s"
    if value < HOURS:
        return f"{number(value / 60.0, 2)} min"
    return f"{number(value / 3600.0, 2)} h"
