"""Each class of light paths is found by the techniques of its table, and by no others: the kernels say so.

All words of up to `LONGEST` surfaces are walked from the camera, and from the light, by the kernels of a
render. What they meet is laid in their way: a matt surface, a metal or a mirror, at a distance of one.
"""

import re
from collections import defaultdict
from itertools import product

import numpy as np
import pytest

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators import INTEGRATORS, PathOptions
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import shadow_rays
from hybrid_rt.integrators.integrator import CameraBlock
from hybrid_rt.integrators.kernels import light_paths as kernels
from hybrid_rt.integrators.kernels.connection_weights import is_found_by_light_paths
from hybrid_rt.integrators.kernels.followed_paths import Arrival, follow_paths
from hybrid_rt.integrators.kernels.path_vertex import MOST_SHADOW_RAYS, Block
from hybrid_rt.integrators.kernels.photon_steps import MET_SPECULAR, MET_SPREADING, Flight
from hybrid_rt.integrators.kernels.ways import ANCHORED
from hybrid_rt.integrators.light_points import new_light_points
from hybrid_rt.integrators.media.contacts import NO_SECOND
from hybrid_rt.integrators.path.camera_paths import leaving_camera
from hybrid_rt.integrators.path.light_paths import new_light_vertices
from hybrid_rt.integrators.path.path_state import columns_of, new_tally
from hybrid_rt.integrators.path.path_tracer import PathTracer
from hybrid_rt.integrators.rows import new_rows, rows_of
from hybrid_rt.integrators.techniques import (
    EMISSION,
    FAR_CONNECTION,
    FOUND_BY_PHOTONS,
    FOUND_BY_WHITTED,
    NEXT_EVENT,
    PHOTONS,
    SPECULAR_NEXT_EVENT,
    SUBPATH,
    found_by_path,
    paths_found,
)
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.kind import new_record
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight
from hybrid_rt.materials import Lambertian, Mirror
from hybrid_rt.materials.rough_conductor import RoughConductor
from hybrid_rt.primitives import Rectangle
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.compiled import NOTHING, compile_scene
from hybrid_rt.scene.plan import make_plan
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.shading.kernels.light_kinds import SURFACE

LETTERS, LONGEST = "DGS", 4
# Metals send some directions into themselves, and a quarter of all vertices are connected: of so many
# copies of a word all are not lost.
COPIES = 64
LAMP, SKY = len(LETTERS), NOTHING
LIGHTS = {
    "L": {"lights": [RectangleLight((-20, -20, 900), (0, 40, 0), (40, 0, 0), 1.0)]},
    "K": {"lights": [], "environment": GradientSky((1, 1, 1), (1, 1, 1), (0, 0, 1))},
    "P": {"lights": [PointLight((0, 0, 900), 1e6)]},
}
TABLES = [
    found_by_path(strategy, subpaths=subpaths, of_surface=of_surface, far=far, by_way=by_way)
    for strategy in ("both", "lights", "directions")
    for subpaths, of_surface, far in product((False, True), repeat=3)
    for by_way in ("", "K", "LK")
]


def words(n, letters=LETTERS):
    return ["".join(word) for word in product(letters, repeat=n)]


def classes_of(table, path):
    return [row.techniques for row in table if re.fullmatch(row.paths, path)]


def test_no_path_is_in_two_classes():
    paths = [f"{light}{word}E" for n in range(LONGEST + 1) for word in words(n) for light in "LPUK"]
    paths += [f"L{word}E" for word in words(LONGEST, "DGSF") if "DFD" in word]
    for table in (*set(TABLES), FOUND_BY_WHITTED, FOUND_BY_PHOTONS):
        for path in paths:
            assert len(classes_of(table, path)) <= 1, path


def path_tracer(light, **options):
    """Return what follows camera paths in a scene of a matt surface, a metal, a mirror and a light."""
    materials = Lambertian(0.9), RoughConductor.of("silver", 0.25), Mirror(0.9)
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40, 16, 16)
    # Apart: a mirror on which another surface lies is not sampled.
    squares = [Rectangle((-1, -1, -z), (2, 0, 0), (0, 2, 0)) for z in range(3)]
    objects = [Object(*pair) for pair in zip(squares, materials, strict=True)]
    scene = compile_scene(Scene(camera, objects, **LIGHTS[light]))
    own = PathOptions(roulette_depth=100, **options)
    plan = make_plan(scene, INTEGRATORS["path"].with_options(own))
    tracer = Intersector(scene.surfaces, threads=1)
    found = PathTracer(RenderContext(scene, tracer, Pool(1), plan, Sampler(3), Ledger(), 16, own))
    found._follows = False  # vertex by vertex
    found._scratch = found._new_scratch()
    return found


def hits_at(paths, object_id, rng, distance=1.0):
    """Return hits in the way of paths, by surfaces that are met at some angle."""
    n = paths.pdf.size
    hits = columns_of(new_record(n))
    normal = rng.normal(0.0, 0.4, (n, 3)) - paths.directions
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    hits.t[:], hits.object_id[:], hits.patch_id[:] = distance, object_id, 0
    hits.u[:] = hits.v[:] = 0.5
    hits.position[:] = paths.origins + distance * paths.directions
    hits.normal[:], hits.front_face[:] = normal, True
    if np.ndim(object_id) == 0 and object_id < 0:
        hits.t[:] = np.inf
    return hits


class Walk:
    """Camera paths by all words of some surfaces, those next to the camera first.

    ``asked``, ``connected``, ``anchored``: words at whose last surface next-event estimation, connections
    and next-event estimation by way of mirrors are techniques. ``emission``: for each word how much of a light
    behind counts, where next-event estimation or light subpaths find it too, or not.
    """

    def __init__(self, tracer, light, letters=LETTERS, longest=LONGEST, distance=1.0):
        self.asked, self.connected, self.anchored = set(), set(), set()
        self.emission = defaultdict(lambda: (0.0, 0.0, 0.0))
        self.ended = set(words(longest, letters))
        rng = np.random.default_rng(5)
        self._tracer, self._rules = tracer, tracer._rules()
        ends = LAMP if light == "L" else SKY
        alive = np.repeat(words(longest, letters), COPIES)
        n = len(alive)
        way = rng.normal(size=(n, 3))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        keys = np.arange(n, dtype=np.uint64)
        block = CameraBlock(keys, np.zeros(n, dtype=np.uint64), np.zeros((n, 3)), way)
        has_paths = self._rules.has_light_paths
        paths = leaving_camera(block, tracer._camera_media, has_paths, tracer._samples_specular)
        self._block = Block(
            block.pixel, block.sample, block.origins, way, tracer._camera_media,
            np.ones(n if has_paths else 0), np.zeros(n if has_paths else 0, dtype=np.int64),
        )  # fmt: skip
        for depth in range(longest + 1):
            seen = np.array([alive[k][:depth] for k in paths.camera_ray])
            if light != "P":
                self._run_into(paths, depth, seen, ends, rng)
            if depth == longest:
                self.ended -= set(seen)
                return
            letter = np.array([LETTERS.index(alive[k][depth]) for k in paths.camera_ray])
            hits = hits_at(paths, letter.astype(np.int32), rng, distance)
            shadows, n_rays, paths, _ = self._follow(tracer._world(), paths, depth, hits)
            at = np.array([alive[k][: depth + 1] for k in shadows.camera_ray[:n_rays]])
            target = shadows.target_id[:n_rays]
            # A light vertex lies on the matt surface; ways by mirrors are known by their anchors.
            is_way = shadows.follows[:n_rays] | np.append(shadows.follows[1:n_rays], False)
            is_light = (target == ends) | ((target < 0) & (light == "P"))
            self.asked |= set(at[is_light & ~is_way])
            self.connected |= set(at[(target == 0) & ~is_way])
            if paths.chain.size:
                here = np.array([alive[k][: depth + 1] for k in paths.camera_ray])
                self.anchored |= set(here[paths.chain == ANCHORED])

    def _follow(self, world, paths, depth, hits):
        tracer, n = self._tracer, paths.pdf.size
        shadows, out = shadow_rays(MOST_SHADOW_RAYS * n), tracer._new_paths(2 * n)
        radiance = np.zeros((self._block.pixel.size, 3))
        arrival = Arrival(hits, NO_SECOND, new_light_points(0), np.zeros(0))
        n_rays, n_out, _ = follow_paths(
            world, self._rules, depth, self._block, paths, 0, arrival, tracer._single.tables,
            tracer._scratch, radiance, shadows, out, tracer._doubtful,
            new_tally(tracer.context.scene.lobes.kind.size),
        )  # fmt: skip
        return shadows, n_rays, rows_of(out, slice(n_out)), radiance

    def _run_into(self, paths, depth, seen, ends, rng):
        """Note the largest weights of light that paths run into."""
        hits = hits_at(paths, ends, rng)
        hits.normal[:] = -paths.directions
        world = self._tracer._world()
        weights = []
        for asked, sent in ((True, True), (True, False), (False, True)):
            lights = world.lights
            lights = lights._replace(chance=lights.chance * asked, emit=lights.emit * sent)
            *_, radiance = self._follow(world._replace(lights=lights), paths, depth, hits)
            weights.append(radiance[paths.camera_ray, 0] / paths.throughput[:, 0])
        for word in set(seen):
            of_word = tuple(float(weight[seen == word].min()) for weight in weights)
            self.emission[word] = of_word


def offered(tracer, n=64):
    """Let camera paths be connected with light vertices all around."""
    rng = np.random.default_rng(7)
    points = new_light_vertices(n, tracer._light.n_slots)
    outward = rng.normal(size=(n, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    points.position[:] = 9.0 * outward
    points.normal[:] = points.geometric[:] = -outward
    points.direction[:] = outward
    points.material[:] = points.object_id[:] = 0
    points.colors[:] = points.flux[:] = 1.0
    points.density[:] = points.strength[:] = points.square[:] = 1.0
    points.ratio[:], points.steps[:] = 0.0, 1
    tracer._vertices_per_path = 1.0
    tracer.take(tracer._light_of(0, points, np.array([0, n])))


def stored_by_light(tracer, of_surface):
    """Return the words, those next to the light first, at whose last surface a light subpath has a vertex."""
    scene, lamps, rng = tracer.context.scene, tracer._lamps, np.random.default_rng(5)
    lights, narrow = scene.lights, scene.narrow_materials
    if of_surface:
        lights = lights._replace(kind=np.full_like(lights.kind, SURFACE))
    alive, found = np.repeat(words(LONGEST), COPIES), set()
    n = len(alive)
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    form = "u8, u8, 3f8, 3f8, 3f8, f8, ?, ?, (0,)i4, i4, ?, i4, f8"
    paths = new_rows(kernels.LightPaths, n, form)
    paths.sample[:], paths.number[:], paths.origins[:], paths.directions[:] = (
        0,
        np.arange(n),
        0,
        way,
    )
    paths.flux[:], paths.density[:], paths.cosine[:] = 1.0, 1.0, 1.0
    paths.is_direct[:], paths.is_left[:], paths.begins_late[:] = True, False, False
    paths.light_id[:], paths.source_id[:] = 0, LAMP
    for step in range(LONGEST):
        m = paths.number.size
        met = [alive[k][: step + 1] for k in paths.number]
        object_id = np.array([LETTERS.index(word[-1]) for word in met], dtype=np.int32)
        at, hits = hits_at(paths_of(paths), object_id, rng), new_record(m)
        for name in at._fields:
            getattr(hits, name)[:] = getattr(at, name)
        material = tracer._light.material(hits)
        shading = tracer._light.shading(hits, paths.directions, material, paths.media, NO_SECOND)
        out, row = new_light_vertices(m, tracer._light.n_slots), np.empty_like(material)
        k = kernels.store_light_vertices(
            paths, scene.lobes, narrow, shading.vertices, hits.object_id, step, False, out, row
        )
        found |= {met[i] for i in row[:k]}
        going = new_rows(kernels.LightPaths, m, form)
        k = kernels.extend_light_paths(
            paths, scene.lobes, lights, narrow, shading.vertices, hits.object_id, lamps.is_smooth,
            NO_SECOND, rng.random((m, 2)), rng.random((m, 2)), step, False, going,
        )  # fmt: skip
        paths = rows_of(going, slice(k))
    return found


def paths_of(light_paths):
    """Return what `hits_at` reads of light subpaths."""

    class Rays:
        pdf, origins, directions = light_paths.density, light_paths.origins, light_paths.directions

    return Rays


def subpaths(word, stored, walk):
    """Return where light subpaths are connected on the way of a word, that next to the light first."""
    found = []
    for k in range(1, len(word) + 1):
        if word[:k] not in stored:
            continue
        # To the camera; or from a wide surface to a vertex of the camera path.
        if k == len(word) or (word[k - 1] == "D" and word[k:][::-1] in walk.connected):
            found.append(k)
    return found


def techniques(word, walk, stored):
    """Return the techniques of the kernels that find light by way of a word; check that weights agree."""
    toward_light, found = word[::-1], set()
    whole, asked, sent = walk.emission[toward_light]
    if whole > 0.0:
        found.add(EMISSION)
    if toward_light in walk.asked:
        found.add(NEXT_EVENT)
    if word[:1] == "S" and toward_light[:-1] in walk.anchored:
        found.add(SPECULAR_NEXT_EVENT)
    connected = subpaths(word, stored, walk)
    assert len(connected) <= 1, (word, connected)
    if connected:
        found.add(SUBPATH)
    if EMISSION in found:
        assert (asked < 1.0) == bool(found & {NEXT_EVENT, SPECULAR_NEXT_EVENT}), word
        assert (sent < 1.0) == (SUBPATH in found), word
    return found


CASES = [("L", {}), ("L", {"light_paths": 0.0}), ("K", {}), ("P", {})]
CASES += [(light, {"strategy": one}) for light in "LKP" for one in ("lights", "directions")]


@pytest.mark.parametrize(("light", "options"), CASES)
def test_path_finds_each_class_by_its_techniques(light, options):
    tracer, stored = path_tracer(light, **options), set()
    has_subpaths = tracer._lamps is not None
    assert has_subpaths == (light == "L" and not options)
    if has_subpaths:
        offered(tracer)
        stored = stored_by_light(tracer, False)
    walk = Walk(tracer, light)
    assert not walk.ended
    table = found_by_path(options.get("strategy", "both"), subpaths=has_subpaths)
    for n in range(LONGEST + 1):
        for word in words(n):
            if light == "P" and not word.strip("S"):
                continue
            (expected,) = classes_of(table, f"{light}{word}E") or [()]
            assert techniques(word, walk, stored) == set(expected), word


def test_without_light_subpaths_lamps_are_reached_by_way_of_mirrors():
    tracer = path_tracer("L")
    tracer._leave_out_light_paths()
    walk, table = Walk(tracer, "L"), found_by_path("both", subpaths=False, by_way="L")
    for n in range(LONGEST + 1):
        for word in words(n):
            (expected,) = classes_of(table, f"L{word}E")
            assert techniques(word, walk, set()) == set(expected), word


def test_light_subpaths_of_bent_lamps_begin_at_no_narrow_surface():
    """Neither do paths from the camera take them for found there."""
    tracer = path_tracer("L")
    offered(tracer)
    stored, walk = stored_by_light(tracer, True), Walk(tracer, "L")
    table = found_by_path("both", subpaths=True, of_surface=True)
    for n in range(1, LONGEST + 1):
        for word in words(n):
            ((*_, last),) = classes_of(table, f"L{word}E")
            assert (last == SUBPATH) == bool(subpaths(word, stored, walk)), word
    world = tracer._world()
    of_surface = world._replace(
        lights=world.lights._replace(kind=np.full_like(world.lights.kind, SURFACE))
    )
    asked = getattr(is_found_by_light_paths, "py_func", is_found_by_light_paths)
    assert asked(world, 1, 1, 0)
    assert not asked(of_surface, 1, 1, 0)


def test_far_light_between_diffuse_surfaces_is_found_by_connections_alone():
    """Beyond a distance they take what a diffuse surface sends to another, and nothing else does."""
    tracer = path_tracer("L")
    tracer._lamps.min_distance = 0.5
    offered(tracer)
    walk = Walk(tracer, "L", longest=2)
    # Light vertices are 9 away: farther than the distance.
    assert walk.connected >= {"D", "SD"}
    # The second surface is 1 away. What it sends to the first is known: paths end there.
    assert walk.ended == {"DD"}
    assert "DD" not in walk.asked | walk.connected | walk.anchored
    near = path_tracer("L")
    near._lamps.min_distance = 2.0
    offered(near)
    walk = Walk(near, "L", longest=2)
    assert not walk.ended
    assert "DD" in walk.asked
    table = found_by_path("both", subpaths=True, far=True)
    assert classes_of(table, "LDFDE") == [(FAR_CONNECTION,)]
    assert classes_of(table, "LDDE") == [(EMISSION, NEXT_EVENT)]


def test_photons_are_stored_from_their_second_flight_on_where_light_is_spread_widely():
    """What comes straight is found by shadow rays, and what metals and mirrors send on by camera paths."""
    from hybrid_rt.integrators.kernels.photon_steps import store_photons
    from hybrid_rt.integrators.photons.photon_tracer import new_photons

    scene = path_tracer("P").context.scene
    gathers = scene.materials_with(1)  # WIDE
    history = {"": 0, "D": MET_SPREADING, "G": MET_SPECULAR, "S": MET_SPECULAR}
    flight = new_rows(Flight, 1, "u8, 3f8, 3f8, 3f8, (0,)i4, i4, u1")
    for column in flight:
        column[...] = 1
    for word in (*words(1), *words(2)):
        flight.history[:] = history[word[:-1]]
        material = np.array([LETTERS.index(word[-1])], dtype=np.int32)
        place = np.ones((1, 3))
        n = store_photons(flight, material, gathers, MET_SPECULAR, place, place, new_photons(1))
        (found,) = classes_of(FOUND_BY_PHOTONS, f"L{word}E")
        assert (n > 0) == (found == (PHOTONS,)), word


def test_declared_light_is_that_of_the_tables():
    for name, table in (
        ("path", found_by_path("both", subpaths=True)),
        ("whitted", FOUND_BY_WHITTED),
        ("ppm", FOUND_BY_PHOTONS),
    ):
        declared = INTEGRATORS[name]
        finds = declared.finds(declared.options())
        for light, n in product("LPUK", range(LONGEST + 1)):
            for word in words(n):
                path = f"{light}{word}E"
                assert bool(re.fullmatch(finds, path)) == bool(
                    re.fullmatch(paths_found(table), path)
                )
