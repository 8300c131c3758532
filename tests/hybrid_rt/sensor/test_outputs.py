"""Outputs replace what is ours alone, and follow no link."""

import os
import re
import stat
from pathlib import Path

import numpy as np
import pytest

from hybrid_rt.core.hit_table import to_csv
from hybrid_rt.sensor.image_files import check_output, save_image
from meshing import outputs
from meshing.bpt import write_patches
from meshing.outputs import check_writable, replacing

NET = np.zeros((2, 2, 3))
IMAGE = np.zeros((1, 1, 3), np.float32)
WRITERS = {
    "picture": ("a.png", lambda file: save_image(file, IMAGE, {"a": 1})),
    "arrays": ("a.npz", lambda file: save_image(file, IMAGE, {"a": 1})),
    "table": ("a.csv", lambda file: to_csv({"t": np.zeros(2)}, file, "path")),
    "patches": ("a.bpt", lambda file: write_patches(file, [NET])),
}
writers = pytest.mark.parametrize(("name", "write"), WRITERS.values(), ids=WRITERS)


def mode_of(file: Path) -> int:
    return stat.S_IMODE(file.stat().st_mode)


@writers
@pytest.mark.parametrize("mode", [0o600, 0o755])
def test_a_file_keeps_its_mode(tmp_path, name, write, mode):
    (tmp_path / name).write_text("{}")
    (tmp_path / name).chmod(mode)
    write(tmp_path / name)
    assert (tmp_path / name).read_bytes() != b"{}"
    assert mode_of(tmp_path / name) == mode


@pytest.mark.parametrize("umask", [0o022, 0o077])
def test_a_new_file_has_the_mode_that_the_user_set(tmp_path, umask):
    before = os.umask(umask)
    try:
        save_image(tmp_path / "a.png", IMAGE, {})
    finally:
        os.umask(before)
    assert {mode_of(file) for file in tmp_path.iterdir()} == {0o666 & ~umask}


def make_link(file: Path) -> None:
    (file.parent / "victim").write_text("precious")
    file.symlink_to(file.parent / "victim")


def make_read_only(file: Path) -> None:
    file.write_text("precious")
    file.chmod(0o444)


OTHERS = {
    "link": (make_link, FileExistsError, "symbolic link to '.*victim'.*: name that file itself"),
    "dangling link": (lambda f: f.symlink_to("gone"), FileExistsError, "symbolic link to 'gone'"),
    "device": (
        lambda f: f.symlink_to("/dev/full"),
        FileExistsError,
        "symbolic link to '/dev/full'",
    ),
    "read-only": (make_read_only, PermissionError, "it is read-only.: make it writable, or name"),
    "folder": (Path.mkdir, IsADirectoryError, "it is a folder.: name another file"),
    "fifo": (os.mkfifo, FileExistsError, "device, FIFO or socket.: name another file"),
}


@writers
@pytest.mark.parametrize(("make", "error", "words"), OTHERS.values(), ids=OTHERS)
def test_what_is_no_plain_file_of_ours_stays(tmp_path, name, write, make, error, words):
    """Before the work as after it."""
    file = tmp_path / name
    make(file)
    before = {item.name: item.lstat().st_mtime_ns for item in tmp_path.iterdir()}
    for attempt in (write, check_writable):
        with pytest.raises(
            error, match=rf"output '.*{re.escape(name)}' cannot be written .*{words}"
        ):
            attempt(file)
    assert {item.name: item.lstat().st_mtime_ns for item in tmp_path.iterdir()} == before


def test_the_new_file_is_opened_as_one_that_nobody_has_put_there(tmp_path, monkeypatch):
    """Even if a name could be guessed."""
    victim = tmp_path / "victim"
    victim.write_text("precious")
    monkeypatch.setattr(outputs.secrets, "token_hex", lambda _: "guessed")
    link = tmp_path / ".guessed.part"
    link.symlink_to(victim)
    for attempt in (
        lambda: save_image(tmp_path / "a.png", IMAGE, {}),
        lambda: check_output(tmp_path / "a.png"),
    ):
        with pytest.raises(FileExistsError, match=r"a\.png' cannot be written"):
            attempt()
    assert victim.read_text() == "precious"
    assert link.is_symlink()


def test_what_appears_at_the_name_during_the_work_stays(tmp_path):
    def write(file: Path) -> None:
        with replacing(file) as new:
            new.write(b"new")
            make_link(file)

    with pytest.raises(FileExistsError, match="symbolic link"):
        write(tmp_path / "a")
    assert (tmp_path / "victim").read_text() == "precious"
    assert sorted(item.name for item in tmp_path.iterdir()) == ["a", "victim"]


def test_the_longest_name_can_be_written(tmp_path):
    file = tmp_path / f"{'x' * 251}.csv"  # 255 bytes are what file systems allow
    to_csv({"t": np.zeros(1)}, file, "path")
    assert file.read_text() == "t\n0.0\n"


@pytest.mark.parametrize(
    "foreign",
    ['{"name": "mine"}', "no JSON", "", "[" * 10**5],
)
def test_a_foreign_file_of_the_name_of_the_report_stays(tmp_path, foreign):
    (tmp_path / "a.json").write_text(foreign)
    words = (
        r"a\.json', the report beside the picture, .* no report of ours: move that file, or name"
    )
    for attempt in (check_output, lambda file: save_image(file, IMAGE, {"seed": 1})):
        with pytest.raises(FileExistsError, match=words):
            attempt(tmp_path / "a.png")
    assert (tmp_path / "a.json").read_text() == foreign
    assert len(list(tmp_path.iterdir())) == 1


def test_a_report_of_ours_is_replaced(tmp_path):
    report = {"versions": {"hybrid_rt": "0"}, "passes": 3}
    save_image(tmp_path / "a.png", IMAGE, report)
    assert check_output(tmp_path / "a.png") == tmp_path / "a.png"
    save_image(tmp_path / "a.png", IMAGE, {**report, "more": 1})
    # One that a caller made up replaces another with the same entries.
    for _ in range(2):
        save_image(tmp_path / "b.png", IMAGE, {"mine": 1})


def test_a_name_with_a_null_byte_is_refused():
    with pytest.raises(
        ValueError, match=r"output is 'a\\x00\.png': pass a path without null bytes"
    ):
        check_output("a\0.png")
