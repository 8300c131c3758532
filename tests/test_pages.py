"""The code on the pages of the documentation runs, prints what the pages show, and is understood."""

import re
import runpy
import shlex

import imageio.v3 as imageio
import numpy as np
import pages
import pytest

# These render and trace for seconds.
LONG = (
    "howto/detector",
    "howto/noise",
    "howto/nonsequential",
    "tutorials/caustic",
    "tutorials/lens",
)
PYTHON = [
    pytest.param(
        page,
        id=str(page.relative_to(pages.ROOT)),
        marks=[pytest.mark.nightly] if page.with_suffix("").as_posix().endswith(LONG) else [],
    )
    for page in pages.pages()
    if pages.blocks_of(page, "python")
]
COMMANDS = sorted(
    {
        (block.page.relative_to(pages.ROOT).as_posix(), " ".join(re.split("[#>]", line)[0].split()))
        for page in pages.pages()
        for block in pages.blocks_of(page, "sh")
        for line in block.code.replace("\\\n", " ").splitlines()
        if re.match(r"hybrid-rt |python (tools|scenes)/", line)
    }
)
ANEW = "if that is right, python tests/helpers/pages.py PAGE writes it anew"
PARSERS = runpy.run_path(str(pages.ROOT / "docs" / "_ext" / "parsers.py"))


@pytest.mark.slow
@pytest.mark.parametrize("page", PYTHON)
def test_python_runs_and_prints_what_is_shown(page, tmp_path):
    every = pages.blocks_of(page, "python")
    assert page.read_text(encoding="utf-8").count("```python") == len(every)
    blocks = [block for block in every if block.reason is None]
    for block, printed in zip(blocks, pages.run(blocks, tmp_path), strict=True):
        if block.output is not None:
            assert pages.differences(printed, block.output) == "", f"{block.name}: {ANEW}"
        else:
            assert printed == "", f"{block.name} prints: show it in a block of text"
    for name in pages.pictures_of(page, tmp_path):
        made, shown = imageio.imread(tmp_path / name), imageio.imread(page.parent / name)
        # Same bits on processors of one kind; elsewhere a path in thousands may turn out otherwise.
        assert np.abs(made.astype(float) - shown).mean() < 0.5, f"{name}: {ANEW}"


@pytest.fixture(scope="module")
def parser_of():
    """Return a program's parser; each is made once."""
    made = {}

    def get(program):
        if program not in made:
            made[program] = PARSERS["parser_of"](program)
        return made[program]

    return get


@pytest.mark.parametrize(("page", "command"), COMMANDS, ids=lambda text: text)
def test_commands_are_understood(page, command, parser_of):
    """Every command in a block of sh has options that exist, and scenes and tools that exist."""
    words = shlex.split(command)
    if words[0] == "python":
        assert (pages.ROOT / words[1]).is_file(), page
        words = words[1:] if words[1].startswith("tools/") else ["hybrid-rt", "render", *words[1:]]
    code = 0
    try:
        parser_of(words[0]).parse_args(words[1:])
    except SystemExit as end:  # an option that prints something and ends, or a wrong one
        code = end.code
    assert not code


@pytest.mark.parametrize(
    ("printed", "shown", "is_alike"),
    [
        ("error 0.0123\n", "error 0.0124", True),
        ("error 0.0123\n", "error 0.0125", False),
        ("1.50e-07 of 12", "1.51e-07 of 12", True),
        ("hit", "miss", False),
        ("1 2", "1", False),
    ],
)
def test_numbers_may_differ_in_their_last_place(printed, shown, is_alike):
    assert (pages.differences(printed, shown) == "") is is_alike
