"""Render one scene as often as asked, by whichever checkout comes first on PYTHONPATH.

`benchmarks.two_checkouts` runs this file as a program of its own and talks to it by lines
of JSON. It uses public names only, so that it also runs with checkouts much older than itself.
"""

from __future__ import annotations

import inspect
import json
import runpy
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np


def main() -> None:
    """Read what to render, then a line for each render; answer each with a line."""
    # The folder of this file is no room of the checkout that renders.
    sys.path[:] = [folder for folder in sys.path if Path(folder).resolve() != Path(__file__).parent]
    # Answers alone go to the parent: what a scene script prints does not.
    answers, sys.stdout = sys.stdout, sys.stderr
    try:
        asked = json.loads(sys.stdin.readline())
        import hybrid_rt

        scene = _scene(asked)
        camera = scene.camera
        _tell(answers, {"home": hybrid_rt.__file__, "size": [camera.width, camera.height]})
        for line in sys.stdin:
            _tell(answers, _rendered(scene, asked, **json.loads(line)))
    except Exception as error:  # noqa: BLE001 (whatever it is, the parent tells it)
        _tell(answers, {"error": f"{type(error).__name__}: {error}"})


def _scene(asked: dict[str, Any]) -> Any:
    file = Path(asked["scene"])
    sys.path.insert(0, str(file.parent))
    scene = runpy.run_path(str(file), run_name="hybrid_rt_scene")["scene"]()
    if asked["width"] is None:
        return scene
    # The oldest checkouts do not keep proportions by themselves.
    camera, width = scene.camera, asked["width"]
    height = max(round(width * camera.height / camera.width), 1)
    return scene.with_camera(camera.resized(width, height))


def _rendered(
    scene: Any, asked: dict[str, Any], passes: int, seed: int, file: str, outputs: list[str]
) -> dict[str, Any]:
    """Render; write image and outputs to a file; return the seconds it took."""
    import hybrid_rt

    settings: dict[str, Any] = {}
    if asked["photons"] is not None:
        kinds = {"ppm": hybrid_rt.PPMOptions, "photon_map": hybrid_rt.PhotonMapOptions}
        settings["options"] = kinds[asked["integrator"]](photons_per_pass=asked["photons"])
    # The oldest checkouts have one way to hits, by Embree.
    if "coarse" in inspect.signature(hybrid_rt.render).parameters:
        settings["coarse"] = asked["coarse"]
    if outputs:
        settings["outputs"] = outputs
    wall, processor = time.perf_counter(), time.process_time()
    result = hybrid_rt.render(
        scene, asked["integrator"], passes, seed=seed, threads=asked["threads"], **settings
    )
    seconds = time.perf_counter() - wall, time.process_time() - processor
    channels = {name: result.channels[name] for name in outputs}
    np.savez(file, image=result.image, **channels)
    return {"wall": seconds[0], "processor": seconds[1]}


def _tell(answers: Any, answer: dict[str, Any]) -> None:
    answers.write(json.dumps(answer) + "\n")
    answers.flush()


if __name__ == "__main__":
    main()
