"""The code blocks of Markdown pages: what runs, and what it prints.

Blocks of ``python`` on one page run in order, in one namespace, in an empty folder that shows the
repository's files. A block of ``text`` right after one holds what it prints. The comment

    <!-- not run: REASON -->

before a block leaves it out. ``python tests/helpers/pages.py PAGE...`` writes anew what the blocks of
pages print, and puts the pictures that they save and that pages show beside them.
"""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import sys
import tempfile
import types
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from hybrid_rt.integrators import INTEGRATORS

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(
    r"(?:<!-- not run: (?P<reason>[^>]+) -->\s*\n)?"
    r"^(?P<indent> *)```(?P<language>python|sh)\n(?P<code>.*?)^(?P=indent)```\n"
    r"(?:\n*^(?P=indent)```text\n(?P<output>.*?)^(?P=indent)```\n)?",
    re.MULTILINE | re.DOTALL,
)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Block:
    """One block of code; ``reason`` is why it does not run, ``output`` None if the page shows none."""

    page: Path
    line: int
    language: str
    code: str
    reason: str | None
    output: str | None

    @property
    def name(self):
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def pages():
    """Return the Markdown pages of the project."""
    found = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    return sorted(page for page in found if "_build" not in page.parts)


def blocks_of(page, language):
    """Return the blocks of one language on a page."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in BLOCK.finditer(text):
        if match["language"] == language:
            code = re.sub(f"^{match['indent']}", "", match["code"], flags=re.MULTILINE)
            line = text[: match.start("code")].count("\n") + 1
            found.append(Block(page, line, language, code, match["reason"], match["output"]))
    return found


def run(blocks, folder):
    """Run blocks in order, in a folder; return what each printed."""
    for item in ROOT.iterdir():
        (folder / item.name).symlink_to(item)
    page, printed = types.ModuleType("page"), []
    with contextlib.chdir(folder), contextlib.ExitStack() as after:
        # Dataclasses look for the module that they are made in; integrators of a page end with it.
        sys.modules["page"] = page
        after.callback(sys.modules.pop, "page")
        after.enter_context(mock.patch.dict(INTEGRATORS))
        for block in blocks:
            out = io.StringIO()
            code = compile("\n" * (block.line - 1) + block.code, block.name, "exec")
            with contextlib.redirect_stdout(out):
                exec(code, vars(page))  # noqa: S102  (the pages are ours)
            printed.append(out.getvalue())
    return printed


def differences(printed, shown):
    """Say how an output differs from the one on the page; "": words alike, numbers but for rounding.

    The last digit may differ by one: another processor may round it otherwise.
    """
    if NUMBER.sub("#", printed).split() != NUMBER.sub("#", shown).split():
        return f"printed:\n{printed}\nshown:\n{shown}"
    for a, b in zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=True):
        if abs(float(a) - float(b)) > 1.0001 * _last_place(b):
            return f"printed {a}, shown {b}"
    return ""


def _last_place(number):
    mantissa, _, exponent = number.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals)


def pictures_of(page, folder):
    """Return the names of pictures that a page shows and that its blocks have saved in a folder."""
    names = re.findall(r"\]\(([\w.]+\.png)\)", page.read_text(encoding="utf-8"))
    return [name for name in names if (folder / name).exists() and not (folder / name).is_symlink()]


def rewrite(page):
    """Write anew what the blocks of a page print, where it shows that, and the pictures they save."""
    text = page.read_text(encoding="utf-8")
    blocks = [block for block in blocks_of(page, "python") if block.reason is None]
    with tempfile.TemporaryDirectory() as folder:
        for block, printed in zip(blocks, run(blocks, Path(folder)), strict=True):
            if block.output is not None:
                before = f"```python\n{block.code}```\n\n```text\n"
                text = text.replace(f"{before}{block.output}```", f"{before}{printed}```")
        page.write_text(text, encoding="utf-8")
        for name in pictures_of(page, Path(folder)):
            shutil.copy(Path(folder) / name, page.parent / name)


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        rewrite(Path(argument).resolve())
