"""Camera, film and picture files."""
