import errno
import json
import logging
import os
import re
import shlex
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import imageio.v3 as imageio
import numpy as np
import pytest

from hybrid_rt._version import __version__
from hybrid_rt.cli import command
from hybrid_rt.cli import program as cli
from hybrid_rt.cli.command import BAD_INPUT, CLOSED_PIPE, INTERRUPTED, STOPPED, TERMINATED
from hybrid_rt.cli.render import _how_to_go_on as how_to_go_on
from hybrid_rt.cli.scene_file import SceneFileError, load_scene
from hybrid_rt.rendering import renderer as rendering
from hybrid_rt.rendering.forecast import further
from hybrid_rt.rendering.report import Report, StoreFigures
from hybrid_rt.sensor import image_files

SCRIPT = """
import sys

from hybrid_rt.sensor.camera import Camera
from hybrid_rt.lights import GradientSky
from hybrid_rt.materials import Mirror
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene.scene import Object, Scene


def scene():
    camera = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=16, height=12)
    return Scene(camera, [Object(Sphere((0, 0, 0), 1), Mirror())], environment=GradientSky(0, 1))


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "ball.py").write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_render_writes_picture_and_report_under_the_scripts_name(folder, capsys):
    assert cli.main(["render", "ball.py", "--passes", "2", "--quiet"]) == 0
    assert imageio.imread("ball.png").shape == (12, 16, 3)
    assert json.loads((folder / "ball.json").read_text())["passes"] == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("ball.png  (2 passes")
    assert captured.err == ""


def test_options_reach_the_picture(folder, capsys):
    arguments = (
        "--passes 1 --width 32 --seed 9 --max-depth 3 --threads 1 --out a.png --out b.npz --explain"
    )
    channels = ["--outputs", "depth, uv"]
    assert cli.main(["render", "ball.py", *arguments.split(), *channels]) == 0
    settings = json.loads((folder / "a.json").read_text())["settings"]
    assert (settings["width"], settings["height"]) == (32, 24)
    assert (settings["seed"], settings["max_depth"], settings["threads"]) == (9, 3, 1)
    with np.load("b.npz") as data:
        assert data["image"].shape == (24, 32, 3)
        assert data["uv"].shape == (24, 32, 2)
    captured = capsys.readouterr()
    assert "+ mirror rays" in captured.out
    assert "Rendering ..." in captured.err


@pytest.mark.parametrize(
    ("limits", "kept", "moved"),
    [
        ("--passes 2", [], "--passes"),
        ("--passes=2", [], "--passes"),
        ("--target-error 0.5", [], "--target-error"),
        ("--target-error 0.5 --passes 4096", ["--passes", "4096"], "--target-error"),
        ("--target-error 0.5 --time-budget 60", [], "--target-error"),
        ("--target-error-trimmed 0.5", [], "--target-error-trimmed"),
    ],
)
def test_the_command_that_goes_on_goes_further(folder, capsys, monkeypatch, limits, kept, moved):
    begin = ["hybrid-rt", "render", "ball.py", "--quiet", "--width", "64", "--store", "kept"]
    words, passes = [*begin, *limits.split()], []
    for _ in range(3):
        monkeypatch.setattr(sys, "argv", words)
        assert cli.main(words[1:]) == 0
        words = shlex.split(re.search(r"go on     (.*)", capsys.readouterr().out)[1])
        assert [word for word in words if word != "--resume"][:-1] == [*begin, *kept, moved]
        report = Report.from_json((folder / "ball.json").read_text())
        passes.append(report.passes)
        error = report.relative_error
        expected = {
            "--passes": further(report).passes,
            "--target-error": 0.5 * error.both,
            "--target-error-trimmed": 0.5 * error.both_trimmed,
        }
        assert words[-1] == f"{expected[moved]:{'d' if moved == '--passes' else '.1g'}}"
    assert 2 * passes[0] <= passes[1] <= passes[2] / 2


@pytest.mark.usefixtures("folder")
def test_after_a_time_budget_the_same_command_goes_on(capsys, monkeypatch):
    words = ["hybrid-rt", "render", "ball.py", "--quiet", "--store", "kept", "--time-budget", "0.1"]
    monkeypatch.setattr(sys, "argv", words)
    assert cli.main(words[1:]) == 0
    command = re.search(r"go on     (.*)", capsys.readouterr().out)[1]
    assert shlex.split(command) == [*words, "--resume"]


@pytest.mark.parametrize(
    "words",
    [
        [sys.executable, "-m", "prog"],
        ["prog"],
    ],
)
def test_the_program_is_named_as_it_can_be_started(folder, words):
    text = f"""#!{sys.executable}
import shlex
from hybrid_rt.cli.render import program_words
print(shlex.join(program_words()))
"""
    for name in ("prog", "prog.py"):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    paths = os.environ["PATH"]
    if words == ["prog"]:
        paths = f"{folder}{os.pathsep}{paths}"
    begun = partial(
        subprocess.run, cwd=folder, env={**os.environ, "PATH": paths}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    said = begun([*words, "render", "--resume"]).stdout
    expected = [sys.executable, "./prog"] if words == ["./prog"] else words
    assert shlex.split(said) == expected
    assert begun([*shlex.split(said), "render", "--resume"]).stdout == said


def test_pixels_that_are_not_finite_are_not_gone_on_from():
    """Passes would be added for ever; a render that is asked to go on adds none."""
    kept = StoreFigures("kept", 0, [], [], "")
    said = how_to_go_on(SimpleNamespace(store=kept, passes=16, stopped_by="not_finite"))
    assert said == "  store     kept holds 16 passes"


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("render ball.py --samples 64", ": did you mean --passes? hybrid-rt render"),
        ("render ball.py --spp=64", ": did you mean --passes? hybrid-rt render"),
        ("render ball.py --pases 4", ": did you mean --passes? hybrid-rt render"),
        ("render ball.py --zzz 4", ": hybrid-rt render"),
        ("render ball.py another.py", ": hybrid-rt render"),
        ("demo --spp 4", ": hybrid-rt demo"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_unknown_options_say_what_was_meant(words, meant, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(words.split())
    assert caught.value.code == BAD_INPUT
    unknown = words.partition(".py ")[2] or "--spp 4"
    said = f"hybrid-rt: error: unrecognized arguments: {unknown}{meant} --help lists what there is"
    assert capsys.readouterr().err.splitlines()[-1] == said


WHOLE = "pass a whole number, such as 64 or 1e5"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("render ball.py --time-budget 1m", "--time-budget: '1m': pass seconds, such as 60"),
        *((f"render ball.py --photons {text}", f"--photons: '{text}': {WHOLE}")
          for text in ("1.5", "many")),
        ("render ball.py --target-error 2x", "--target-error: '2x': pass a share, such as 0.02 or 2%"),
        ("render ball.py --progress loud", "--progress: invalid choice: 'loud'"),
        *((f"compare a.npz b.npz --exposure {text}",
           f"--exposure: '{text}' stops: pass a number from -100 to 100")
          for text in ("nan", "101")),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("folder")
def test_what_is_no_number_or_choice_is_refused_in_words(words, said, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(words.split())
    assert caught.value.code == BAD_INPUT
    assert f"argument {said}" in capsys.readouterr().err


def test_no_picture_is_written_into_a_store(folder, capsys):
    """It would be taken for a stranger's file, and the store could not be gone on from."""
    kept = folder / "kept"
    kept.mkdir()
    words = ["render", "ball.py", "--quiet", "--store", "kept", "--out", "kept/ball.png"]
    assert cli.main(words) == 2
    said = capsys.readouterr().err
    assert "--out kept/ball.png is in the folder of --store kept" in said
    assert not list(kept.iterdir())


def test_ctrl_c_before_a_pass_says_what_the_store_holds(folder, capsys, monkeypatch):
    """Nothing at first; later, while a render is set up to go on, what it held."""
    words = ["render", "ball.py", "--quiet", "--store", "kept"]

    def interrupted(*_arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(rendering, "audit", interrupted)
        assert cli.main(words) == 130
    said = "interrupted before a pass was complete: no picture is written, and store"
    place = str(folder / "kept")
    assert capsys.readouterr().err == f"\nhybrid-rt: {said} {place!r} holds no pass\n"
    assert not (folder / "kept").exists()
    assert cli.main([*words, "--passes", "1"]) == 0
    with monkeypatch.context() as patch:
        patch.setattr(rendering, "audit", interrupted)
        assert cli.main([*words, "--passes", "2", "--resume"]) == 130
    assert capsys.readouterr().err == f"\nhybrid-rt: {said} {place!r} holds what it held before\n"
    assert cli.main([*words, "--passes", "2", "--resume"]) == 0
    assert "2 passes, 1 of them from before" in capsys.readouterr().out


def test_script_runs_as_a_program(folder):
    """With the integrator that it names, also where its function is decorated."""
    decorated = SCRIPT.replace("def scene", "@functools.cache\ndef scene")
    (folder / "ball.py").write_text('import functools\nINTEGRATOR = "whitted"\n' + decorated)
    command = [sys.executable, "ball.py", "--passes", "1", "--height", "6", "--quiet"]
    subprocess.run(command, check=True, cwd=folder, timeout=120)
    assert imageio.imread("ball.png").shape == (6, 8, 3)
    report = json.loads((folder / "ball.json").read_text())
    assert report["settings"]["integrator"] == "whitted"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.py"], "scene script 'missing.py': there is no such file"),
        (["ball.py", "--passes", "0"], "passes"),
        (["ball.py", "--integrator", "magic"], "declares is named by its INTEGRATOR instead"),
        (["ball.py", "--out", "a.jpg"], "unknown ending"),
        (["ball.py", "--out", "nowhere/a.png"], "no folder"),
        (["ball.py", "--outputs", "depth"], "--outputs depth: a .png holds none of them: add"),
        (["ball.py", "--outputs", "denoised"], "is no output, pass --denoise"),
    ],
)
def test_bad_input_is_one_clear_line_and_exit_code_two(folder, capsys, arguments, words):
    """The line stands alone: nothing was begun."""
    assert cli.main(["render", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert [path.name for path in folder.iterdir()] == ["ball.py"]


def test_a_mesh_is_no_scene_script(folder, capsys):
    (folder / "part.STL").write_bytes(bytes(84))
    assert cli.main(["render", "part.STL"]) == 2
    assert "TriangleMesh.read('part.STL')" in capsys.readouterr().err
    (folder / "mine.npz").write_bytes(b"PK")
    assert cli.main(["render", "mine.npz"]) == 2
    assert "that is none; pass a .py with a function scene()" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1", "no function scene"),
        ("def scene():\n    return 3", "returned int"),
        ("def scene(:", "line 1: SyntaxError"),
        (SCRIPT + 'INTEGRATOR = "magic"', "bad.py: INTEGRATOR is 'magic': pass one of path"),
        (
            "from hybrid_rt.materials import *\n\ndef scene():\n    Mirror(2)",
            "line 4: Mirror color",
        ),
        ("def scene():\n    raise OSError('two\\n lines')", "line 2: OSError: two lines"),
        (
            "from hybrid_rt import *\n\ndef scene():\n    return Dielectic(1.5)",
            r"line 4: NameError: name 'Dielectic' is not defined: did you mean 'Dielectric'\?$",
        ),
        (
            "from hybrid_rt import *\n\ndef scene():\n    return Camera((0, 0, 1), (0, 0, 0), apperture=1)",
            r"line 4: TypeError: .* argument 'apperture': did you mean 'aperture'\?$",
        ),
        (
            "import hybrid_rt\nhybrid_rt.Sphree",
            r"line 2: AttributeError: .* 'Sphree': did you mean 'Sphere'\?$",
        ),
        ("import hybrid_rt\nexec('x = = 3')", r"bad.py, line 2: SyntaxError: invalid syntax"),
    ],
)
def test_faulty_scripts_are_named_with_their_line(tmp_path, text, words):
    script = tmp_path / "bad.py"
    script.write_text(text)
    with pytest.raises(SceneFileError, match=words) as caught:
        load_scene(script)
    assert "bad.py" in str(caught.value)


LENS = """
from hybrid_rt import Sphere
def lens():
    return Sphere((0, 0, 0), {radius})
"""
LATE = """
from hybrid_rt import Camera, Lambertian, Object, Scene
import lens
def scene():
    from parts import glass
    objects = [Object(lens.lens(), Lambertian(0.5), glass.NAME)]
    return Scene(Camera((0, -4, 0), (0, 0, 0), (0, 0, 1)), objects)
"""


def test_scripts_import_what_lies_beside_them_and_leave_nothing(tmp_path):
    """Two scripts, each with a lens and a package of its own; also from within scene()."""
    path, modules = list(sys.path), set(sys.modules)
    for radius in (1.0, 2.0):
        folder = tmp_path / str(radius)
        (folder / "parts").mkdir(parents=True)
        (folder / "lens.py").write_text(LENS.format(radius=radius))
        (folder / "parts" / "glass.py").write_text(f"NAME = 'lens of {radius}'")
        (folder / "late.py").write_text(LATE)
        item = load_scene(folder / "late.py").objects[0]
        assert (item.surface.radius, item.name) == (radius, f"lens of {radius}")
        assert sys.path == path
        assert not {"lens", "parts", "parts.glass"} & (set(sys.modules) - modules)


def test_neighbours_that_fail_are_told_by_the_scripts_line(tmp_path):
    path = list(sys.path)
    (tmp_path / "lens.py").write_text("import nowhere_at_all")
    (tmp_path / "late.py").write_text(LATE)
    with pytest.raises(
        SceneFileError, match=r"late\.py, line 3: .*No module named 'nowhere_at_all'"
    ):
        load_scene(tmp_path / "late.py")
    assert sys.path == path
    assert "lens" not in sys.modules


@pytest.mark.parametrize(
    "arguments",
    ["--passes 0", "--integrator magic"],
)
def test_settings_are_refused_before_the_script_runs(tmp_path, capsys, arguments):
    (tmp_path / "slow.py").write_text("raise ValueError('it runs')")
    assert cli.main(["render", str(tmp_path / "slow.py"), *arguments.split()]) == BAD_INPUT
    assert "it runs" not in capsys.readouterr().err


def test_ctrl_c_in_a_script_is_no_fault_of_it(tmp_path):
    (tmp_path / "slow.py").write_text("raise KeyboardInterrupt")
    assert cli.main(["render", str(tmp_path / "slow.py")]) == INTERRUPTED


def test_a_script_that_runs_as_a_program_names_the_line_as_well(folder):
    (folder / "bad.py").write_text(SCRIPT.replace("    camera =", "    1 / 0\n    camera ="))
    command = [sys.executable, "bad.py", "--quiet"]
    done = subprocess.run(
        command, check=False, cwd=folder, timeout=120, capture_output=True, text=True
    )
    line = SCRIPT.split("\n").index("def scene():") + 2
    assert done.stderr.startswith("hybrid-rt: ")
    assert done.stderr.endswith(f"bad.py, line {line}: ZeroDivisionError: division by zero\n")
    assert (done.returncode, done.stderr.count("\n")) == (BAD_INPUT, 1)


def test_a_closed_pipe_ends_without_a_word_and_loses_no_file(folder):
    code = "import sys; from hybrid_rt.cli.program import main; sys.exit(main(sys.argv[1:]))"
    words = ["render", "ball.py", "--passes", "1", "--quiet", "--explain"]
    words += ["--out", "a.png", "--out", "b.npz"]
    with subprocess.Popen(
        [sys.executable, "-c", code, *words],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as command:  # fmt: skip
        command.stdout.close()
        assert command.stderr.read() == ""
        assert command.wait(timeout=120) == CLOSED_PIPE
    assert {path.name for path in folder.iterdir()} == {
        "ball.py", "a.png", "a.json", "b.npz", "b.npz.json",
    }  # fmt: skip


def test_a_file_that_cannot_be_written_does_not_take_the_others_with_it(
    folder, capsys, monkeypatch
):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setitem(image_files.WRITERS, ".png", full)
    words = ["--passes", "1", "--quiet", "--out", "a.png", "--out", "b.npz", "--out", "c.png"]
    assert cli.main(["render", "ball.py", *words]) == BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out.startswith("b.npz  (1 pass")
    assert "stopped   by the number of passes" in captured.out
    lines = captured.err.splitlines()
    assert len(lines) == 2
    for name, line in zip("ac", lines, strict=True):
        assert line == (
            f"hybrid-rt: output '{folder / name}.png' cannot be written (No space left on device): "
            "name another file"
        )
    assert {path.name for path in folder.iterdir()} == {"ball.py", "b.npz", "b.npz.json"}


@pytest.mark.parametrize("words", [[], ["--out", "a.png"]])
def test_a_script_that_goes_elsewhere_does_not_take_the_picture_with_it(folder, words):
    (folder / "elsewhere").mkdir()
    moving = SCRIPT.replace("    camera =", '    import os; os.chdir("elsewhere")\n    camera =')
    (folder / "ball.py").write_text(moving)
    assert cli.main(["render", "ball.py", "--passes", "1", "--quiet", *words]) == 0
    name = "a" if words else "ball"
    assert {path.name for path in folder.iterdir()} == {
        "ball.py", "elsewhere", f"{name}.png", f"{name}.json",
    }  # fmt: skip
    assert not list((folder / "elsewhere").iterdir())


@pytest.mark.usefixtures("folder")
@pytest.mark.filterwarnings("default")
def test_warnings_are_lines_without_places_in_the_code(capsys):
    arguments = "--integrator ppm --photons 100 --alpha 1 --passes 1 --quiet"
    assert cli.main(["render", "ball.py", *arguments.split()]) == 0
    error = capsys.readouterr().err
    assert error.startswith("hybrid-rt: warning: PPMOptions alpha: at 1 the discs never shrink")
    assert error.count("\n") == 1


@pytest.mark.usefixtures("folder")
def test_what_the_library_logs_is_a_line_above_the_bar(capsys, monkeypatch):
    """But not what the report says at the end in any case."""
    monkeypatch.setenv("COLUMNS", "80")
    renders = rendering.render

    def talkative(*arguments, **settings):
        settings["progress"]("Building", 0, 0)
        logging.getLogger("hybrid_rt.scene").info("not shown")
        logging.getLogger("hybrid_rt.scene").warning("the lamp is dark")
        logging.getLogger("hybrid_rt.report").warning("not shown here")
        return renders(*arguments, **settings)

    monkeypatch.setattr(rendering, "render", talkative)
    log = logging.getLogger("hybrid_rt")
    before = log.level, list(log.handlers)
    assert cli.main(["render", "ball.py", "--passes", "1", "--progress", "bar"]) == 0
    error = capsys.readouterr().err
    blank = " " * len("Building ...")
    expected = f"\rBuilding ...\r{blank}\rhybrid-rt: warning: the lamp is dark\n\rBuilding ..."
    assert error.startswith(expected)
    assert "not shown" not in error
    assert (log.level, log.handlers) == before


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["--progress", "plain"], ["Building ...", "Rendering ..."]),
        (["--progress", "auto"], ["Building ...", "Rendering ..."]),
        (["--progress", "none"], []),
        (["--quiet"], []),
    ],
)
@pytest.mark.usefixtures("folder")
def test_progress_is_shown_as_asked(words, shown, capsys):
    """The standard error of a test is no terminal, so lines are plain."""
    assert cli.main(["render", "ball.py", "--passes", "1", *words]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if "Preparing kernels" not in line] == shown


class TestExitCodes:
    """Those that docs/command_line.md lists; 2, 130 and 141 of whole commands are above."""

    PAGE = (Path(__file__).parents[3] / "docs" / "command_line.md").read_text(encoding="utf-8")

    def test_all_are_documented(self):
        codes = [int(code) for code in re.findall(r"^\| (\d+) \|", self.PAGE, re.MULTILINE)]
        assert codes == [0, 1, BAD_INPUT, STOPPED, INTERRUPTED, CLOSED_PIPE, TERMINATED]

    @pytest.mark.parametrize(
        ("raised", "code"),
        [
            (None, 0),
            (ValueError("x"), BAD_INPUT),
            (OSError("x"), BAD_INPUT),
            (MemoryError(), BAD_INPUT),
            (KeyboardInterrupt(), INTERRUPTED),
        ],
    )
    def test_of_what_ends_a_command(self, raised, code):
        def run():
            if raised is not None:
                raise raised

        assert command.guarded("tool", run, str) == code

    def test_a_tool_whose_check_fails_ends_with_one(self):
        assert command.guarded("tool", lambda: 1, str) == 1

    def test_a_fault_of_the_program_keeps_its_traceback_and_ends_with_one(self):
        code = (
            "import sys; from hybrid_rt.cli.command import guarded\n"
            "sys.exit(guarded('tool', lambda: 1 // 0, str))"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], check=False, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 1
        assert "ZeroDivisionError" in done.stderr


def test_version_and_help(capsys):
    for flag, words in (("--version", __version__), ("--help", "hybrid-rt render scenes/vase.py")):
        with pytest.raises(SystemExit) as caught:
            cli.main([flag])
        assert caught.value.code == 0
        assert words in capsys.readouterr().out


def test_command_line_is_ready_before_anything_heavy_is_imported():
    code = (
        "import sys, hybrid_rt.cli.program; print({'numpy', 'numba', 'imageio'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.strip() == "set()"


def test_photons_are_counted_by_those_who_have_them(folder, capsys):
    (folder / "caustic.py").write_text(SCRIPT + 'INTEGRATOR = "ppm"\n')
    arguments = ["render", "caustic.py", "--passes", "1", "--photons", "500", "--quiet"]
    for named in ([], ["--integrator", "photon_map"]):  # the command line has the last word
        assert cli.main([*arguments, *named]) == 0
        settings = json.loads((folder / "caustic.json").read_text())["settings"]
        assert settings["integrator"] == (named[-1] if named else "ppm")
    arguments[1] = "ball.py"
    assert cli.main([*arguments, "--integrator", "ppm"]) == 0
    report = json.loads((folder / "ball.json").read_text())
    assert report["settings"]["options"]["photons_per_pass"] == 500
    assert report["photons"]["emitted"] == 0  # nothing in the scene gathers them
    assert cli.main(arguments) == BAD_INPUT
    assert "--photons: integrator 'path' has none" in capsys.readouterr().err


def test_what_keeps_numba_from_starting_is_told_in_one_sentence(folder):
    del folder
    command = [sys.executable, "-m", "hybrid_rt", "render", "ball.py"]
    env = {**os.environ, "NUMBA_NUM_THREADS": "0"}
    ended = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert ended.returncode == BAD_INPUT
    assert ended.stderr == (
        "hybrid-rt: numba cannot start (Number of threads specified must be > 0.): see the environment "
        "variables named NUMBA_..., NUMBA_NUM_THREADS must be from 1 on\n"
    )
