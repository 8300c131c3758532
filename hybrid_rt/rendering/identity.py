"""What decides the bits of a pass, and in words where two renders differ in it."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from hybrid_rt.core.fingerprint import fingerprint
from hybrid_rt.core.plain_records import as_json
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.rendering.settings import Settings
from hybrid_rt.rendering.versions import versions
from hybrid_rt.scene.scene import Scene

# Of differences between two identities so many are named.
MOST_NAMED = 4


def identity(scene: Scene, settings: Settings) -> dict[str, Any]:
    """Return what decides the bits of a pass, as `PassStore.open` takes it.

    Raises TypeError if it cannot be told whether a later render has the same scene and code.
    """
    camera = scene.camera
    parts: dict[str, Any] = {"camera": camera, "environment": scene.environment}
    parts |= {f"lights[{i}]": light for i, light in enumerate(scene.lights)}
    parts |= {f"objects[{i}]": found for i, found in enumerate(scene.objects)}
    size = {"width": camera.width, "height": camera.height}
    name = settings.integrator
    return {
        "scene": {name: _fingerprint(part, f"the scene's {name}") for name, part in parts.items()},
        "settings": {**settings.decisive, **size},
        "code": {name: _fingerprint(INTEGRATORS[name], f"integrator {name!r}")},
        "versions": versions(),
    }


def _fingerprint(value: Any, name: str) -> str:
    try:
        return fingerprint(value)
    except TypeError as error:
        raise TypeError(
            f"store: whether {name} stays the same cannot be told ({error}): make it of plain data "
            "and functions, or render without a store"
        ) from None


def differences(own: Mapping[str, Any], held: Mapping[str, Any]) -> list[str]:
    """Say in words where two identities differ, as JSON holds them; empty if they are of the same render.

    ``own`` is what is asked for ("here"), ``held`` what the store has ("there"). Options that are not given
    are those of the integrator by default.
    """
    found = []
    for heading in dict.fromkeys((*held, *own)):
        a, b = held.get(heading), own.get(heading)
        if heading == "code" and a is None:
            continue  # of an older format, which differs
        if not (isinstance(a, dict) and isinstance(b, dict)):
            found += [] if a == b else [f"{heading} {a} there, {b} here"]
        elif heading == "code":  # of other integrators the settings tell
            changed = [name for name in a if b.get(name, a[name]) != a[name]]
            found += [f"the code of integrator {name!r} differs" for name in changed]
        elif heading == "scene":
            for name in unequal(a, b):
                place = "is only there" if name in a else "is only here"
                how = "differs" if name in a and name in b else place
                found.append(f"the scene's {name} {how}")
        else:
            for name in unequal(a, b):
                if name == "options":
                    found += _options(a, b)
                else:
                    found.append(f"{name} {a.get(name)!r} there, {b.get(name)!r} here")
    more = len(found) - MOST_NAMED
    return [*found[:MOST_NAMED], f"and {more} more"] if more > 0 else found


def unequal(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[str]:
    """Return the names under which two dicts differ."""
    return [name for name in dict.fromkeys((*a, *b)) if a.get(name) != b.get(name)]


def _options(there: dict[str, Any], here: dict[str, Any]) -> list[str]:
    """Say where the options of two renders differ; nothing if their integrators do."""
    if there.get("integrator") != here.get("integrator"):
        return []
    declared = INTEGRATORS[here["integrator"]].options
    defaults = json.loads(as_json(asdict(declared())))
    a, b = ({**defaults, **(settings["options"] or {})} for settings in (there, here))
    flags = declared.flags()
    found = []
    for name in unequal(a, b):
        flag = f" (--{flags[name].name})" if name in flags else ""
        found.append(f"{name}{flag} {a.get(name)!r} there, {b.get(name)!r} here")
    return found
