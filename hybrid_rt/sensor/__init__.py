"""Camera, film (`film` sums passes and estimates noise), error metrics, image files."""
