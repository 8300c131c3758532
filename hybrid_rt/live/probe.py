"""What a pixel holds, and what the camera ray through its centre meets."""

import threading
from typing import Any

import numpy as np

from hybrid_rt.core.plain_records import as_plain
from hybrid_rt.core.records import HitRecord, Status
from hybrid_rt.materials.material import Material
from hybrid_rt.rendering.watcher import Beginning
from hybrid_rt.sensor.film import Film
from hybrid_rt.sensor.intervals import SURROUNDINGS
from hybrid_rt.textures.texture import ConstantTexture, Texture


class Probe:
    """Answers for one pixel at a time, in any thread, while the render goes on.

    The ray is traced by a copy of the tracer with counters of its own, so no count of the report changes.
    """

    def __init__(self, beginning: Beginning, film_lock: threading.Lock) -> None:
        self._film, self._film_lock = beginning.film, film_lock
        self._scene, self._compiled = beginning.scene, beginning.context.scene
        self._tracer = beginning.context.tracer.with_own_counters()
        self._one_at_a_time = threading.Lock()

    def at(self, column: int, row: int) -> dict[str, Any]:
        """Return what is known of a pixel, as JSON types; raise ValueError if there is no such pixel."""
        camera = self._compiled.camera
        if not (0 <= column < camera.width and 0 <= row < camera.height):
            raise ValueError(
                f"pixel ({column}, {row}): pass a column below {camera.width} and a row below "
                f"{camera.height}"
            )
        with self._film_lock:
            around, place = _crop(self._film, column, row)
        found: dict[str, Any] = {"column": column, "row": row, "passes": around.n_passes}
        found["value"] = around.image[place].tolist() if around.n_passes else None
        found["half_interval"] = around.half_interval[place].tolist()
        origin, direction = camera.rays(np.array([column + 0.5]), np.array([row + 0.5]))
        found["ray"] = {"origin": origin[0].tolist(), "direction": direction[0].tolist()}
        with self._one_at_a_time:
            hits = self._tracer.intersect(origin, direction)
        found["hit"] = self._hit(hits) if hits.hit[0] else None
        return as_plain(found, finite=True)

    def _hit(self, hits: HitRecord) -> dict[str, Any]:
        number = int(hits.object_id[0])
        is_object = number < len(self._scene.objects)
        return {
            "object": self._compiled.names[number] if is_object else self._light(number),
            "surface": type(self._compiled.surfaces[number]).__name__,
            "material": material_in_words(self._scene.objects[number].material)
            if is_object
            else "shines only",
            "t": hits.t[0],
            "t_bound": hits.t_bound[0],
            "position": hits.position[0].tolist(),
            "normal": hits.normal[0].tolist(),
            "uv": [hits.u[0], hits.v[0]],
            "patch": int(hits.patch_id[0]),
            "front": bool(hits.front_face[0]),
            "tangent": bool(hits.status[0] == Status.TANGENT),
        }

    def _light(self, number: int) -> str:
        row = int(self._compiled.light_of[number])
        return f"lights[{row}] (a {type(self._scene.lights[row]).__name__})"


def material_in_words(material: Material) -> str:
    """Return the name of a material and its colours."""
    parts = [type(material).__name__]
    for lobe in material.lobes:
        weight = "" if lobe.weight == 1.0 else f"{lobe.weight:.3g} of "
        parts.append(f"{weight}colour {_color(lobe.color)}")
    if material.radiance is not None:
        parts.append(f"radiance {_color(material.radiance)}")
    return ", ".join(parts)


def _color(texture: Texture) -> str:
    if not isinstance(texture, ConstantTexture):
        return f"by {type(texture).__name__}"
    values = [f"{x:.3g}" for x in texture.brightest]
    return values[0] if len(set(values)) == 1 else f"({', '.join(values)})"


def _crop(film: Film, column: int, row: int) -> tuple[Film, tuple[int, int]]:
    """Return a film of a pixel and what its interval follows from around it, and its place."""
    state = film.state()
    height, width, _ = state["run"].shape
    rows = slice(max(row - SURROUNDINGS, 0), min(row + SURROUNDINGS + 1, height))
    columns = slice(max(column - SURROUNDINGS, 0), min(column + SURROUNDINGS + 1, width))
    kept = {
        name: values[..., rows, columns, :] if values.ndim >= 3 else values
        for name, values in state.items()
    }
    small = Film(rows.stop - rows.start, columns.stop - columns.start)
    small.restore(kept)
    return small, (row - rows.start, column - columns.start)
