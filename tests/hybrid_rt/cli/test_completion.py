import subprocess
import sys

import pytest

from hybrid_rt.cli.program import main

pytest.importorskip("shtab")


def script(shell, capsys):
    with pytest.raises(SystemExit) as end:
        main(["--print-completion", shell])
    assert end.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["ren"], {"render"}),
        (["render", "--target-e"], {"--target-error", "--target-error-trimmed"}),
        (["render", "--phot"], {"--photons"}),  # declared by integrators
        (["render", "ball"], {"ball.py"}),
        (["study", "ball"], {"ball.py"}),
    ],
)
def test_bash_completes_commands_options_and_files(tmp_path, capsys, typed, offered):
    (tmp_path / "ball.py").touch()
    words = " ".join(["hybrid-rt", *typed])
    code = (
        f"{script('bash', capsys)}\nCOMP_WORDS=({words}); COMP_CWORD={len(typed)}\n"
        "_shtab_hybrid_rt 2>/dev/null\nprintf '%s\\n' \"${COMPREPLY[@]}\""
    )
    done = subprocess.run(
        ["bash", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert {word.strip() for word in done.stdout.split()} == offered


def test_without_shtab_the_extra_is_named(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "shtab", None)
    with pytest.raises(SystemExit) as end:
        main(["--print-completion", "zsh"])
    assert end.value.code == 2
    assert "pip install 'hybrid-rt[completion]'" in capsys.readouterr().err


def test_the_module_is_the_command():
    done = subprocess.run(
        [sys.executable, "-m", "hybrid_rt", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("hybrid-rt ")
