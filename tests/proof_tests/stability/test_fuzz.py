"""Random surfaces and scenes, a few of each: `run_fuzz` tries more; and damaged files."""

import io

import imageio.v3 as imageio
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from hybrid_rt.analysis.picture_comparison import load_picture
from hybrid_rt.textures import ImageTexture
from meshing import BezierPatches
from proof.stability import fuzz, fuzz_properties
from proof.stability.fuzz_cases import build
from proof.stability.row import Effort, all_rows

pytestmark = pytest.mark.slow

FOUND = {row_id: entry for row_id, entry in all_rows().items() if row_id[0] == "G"}

# No database, the same cases every time, and no clock: kernels compile when they are first used.
SETTINGS = settings(
    derandomize=True,
    database=None,
    deadline=None,
    phases=(Phase.explicit, Phase.generate, Phase.shrink),
    suppress_health_check=list(HealthCheck),
)


@settings(SETTINGS, max_examples=50)
@given(fuzz.strategy("surfaces"))
def test_hits_on_surfaces_of_one_class(case):
    assert fuzz.faults_of(case) == ()


@settings(SETTINGS, max_examples=40)
@given(fuzz.strategy("mixed"))
def test_hits_on_mixtures(case):
    assert fuzz.faults_of(case) == ()


@settings(SETTINGS, max_examples=150)
@given(fuzz.strategy("scene"))
def test_scenes_are_rendered_or_refused(case):
    assert fuzz.faults_of(case) == ()


READERS = {
    "bpt": BezierPatches.read, "png": ImageTexture, "bmp": ImageTexture, "npz": load_picture
}  # fmt: skip
RAMP = np.linspace(0, 1, 4 * 5 * 3).reshape(4, 5, 3)


def sound_file(ending):
    """Return the bytes of a small sound file."""
    stream = io.BytesIO()
    if ending == "bpt":
        points = "".join(f"{x} {y} {0.1 * x * y}\n" for x in range(3) for y in range(2))
        return f"1\n2 1\n{points}".encode()
    if ending == "npz":
        np.savez(stream, image=RAMP.astype(np.float32))
    else:
        imageio.imwrite(stream, np.uint8(255 * RAMP), extension=f".{ending}")
    return stream.getvalue()


@settings(SETTINGS, max_examples=200)
@given(st.data(), st.sampled_from(sorted(READERS)))
def test_damaged_files_are_read_or_refused_by_name(tmp_path_factory, data, ending):
    """Stretches of up to 20 bytes are replaced by others, left out or doubled."""
    content = sound_file(ending)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        on = data.draw(st.integers(max(at - 20, 0), at + 20))
        content = content[:at] + data.draw(st.binary(max_size=1)) + content[on:]
    file = tmp_path_factory.mktemp("damaged") / f"damaged.{ending}"
    file.write_bytes(content)
    try:
        READERS[ending](file)
    except (ValueError, TypeError, OSError) as error:
        words = str(error)
    else:
        return
    # What is in the file may be named instead, once it was read.
    assert any(name in words for name in (file.name, "BezierPatches patch"))


@pytest.mark.parametrize("row_id", FOUND)
def test_what_was_found_holds(row_id):
    outcome = FOUND[row_id].run(Effort())
    assert outcome.holds, outcome.faults


def test_failures_are_cut_down_kept_and_run_again(tmp_path, monkeypatch):
    """A tracer that loses hits is found, on one surface and few rays."""
    judge = fuzz_properties.Judge.judge

    def losing(self, hits, origins, directions):
        lost = hits.hit & (directions[:, 0] > 0)
        hits.t[lost], hits.object_id[lost] = np.inf, -1
        return judge(self, hits, origins, directions)

    monkeypatch.setattr(fuzz_properties.Judge, "judge", losing)
    failure = fuzz.searched("surfaces", 1)
    assert len(failure.case["surfaces"]) == 1
    assert len(failure.case["origins"]) < fuzz.N_RAYS
    file = failure.save(tmp_path)
    again = fuzz.read_failure(file)
    assert again == failure
    assert fuzz.faults_of(again.case) == failure.faults
    monkeypatch.undo()
    assert fuzz.faults_of(again.case) == ()
    build(again.case["surfaces"][0])


def test_the_loop_keeps_what_it_finds(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "faults_of", lambda *_: ("something does not hold",))
    found = fuzz.run_fuzz(0.002, seed=3, out=tmp_path)
    assert len(list((tmp_path / "failures").glob("*.json"))) == len(found) > 0
