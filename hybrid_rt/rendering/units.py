"""Shares, passes and seconds as words of a report."""

# Seconds that are better said in minutes.
LONG = 120.0


def per_cent(share: float) -> str:
    """Format a fraction in per cent, two digits: "0.35 %", "190 %"."""
    two_digits = f"{100.0 * share:.2g}"
    is_large = 100.0 <= float(two_digits) < 1e9  # where two digits would have an exponent
    return f"{float(two_digits):,.0f} %" if is_large else f"{two_digits} %"


def passes_in_words(n: int) -> str:
    """Format the number of passes."""
    return "1 pass" if n == 1 else f"{n} passes"


def duration(seconds: float) -> str:
    """Format seconds, from two minutes on with the hours and minutes: "9.6 s", "1 h 5 min"."""
    if seconds < LONG:
        return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds:.0f} s"
    hours, minutes = divmod(round(seconds / 60.0), 60)
    return f"{hours:,} h {minutes} min" if hours else f"{minutes} min"
