"""Ray-patch intersection: `trace` walks the cells, `solve` iterates, `subdivide` searches all."""
