"""Camera, film (`film` sums passes and estimates noise, `intervals` states it), error metrics, files."""
