"""What a picture may hold beside radiance, by name."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid_rt.core import checks

# Names of a channel's parts; () is a single number per pixel.
PARTS: dict[str, tuple[str, ...]] = {
    "depth": (),
    "position": ("X", "Y", "Z"),
    "normal": ("X", "Y", "Z"),
    "uv": ("U", "V"),
    "object_id": (),
    "albedo": ("R", "G", "B"),
    "samples": (),
    "standard_error": ("R", "G", "B"),
    "half_interval": ("R", "G", "B"),
}


OF_PASSES = {"samples", "standard_error", "half_interval"}


def check_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names, each once, or raise ValueError naming the unknown one."""
    given = checks.items(names, "outputs")
    for name in given:
        checks.choice(name, "output", PARTS)
    return tuple(dict.fromkeys(given))
