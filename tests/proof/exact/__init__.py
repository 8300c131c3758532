"""All crossings of a ray in exact arithmetic: the judge of judges (needs python-flint)."""
