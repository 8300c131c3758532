"""What the documents point to exists."""

import re
from pathlib import Path

import pytest

import hybrid_rt
import meshing
from hybrid_rt._version import __version__

ROOT = Path(__file__).parents[1]
LIGHT, PHOTONS = (
    (ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("light.md", "photons.md")
)


@pytest.mark.parametrize("pointer", sorted(set(re.findall(r"`(\S+\.py::\w+)`", LIGHT + PHOTONS))))
def test_tests_that_are_pointed_to(pointer):
    path, name = pointer.split("::")
    assert f"def {name}(" in (ROOT / "tests" / path).read_text(encoding="utf-8")


@pytest.mark.parametrize(("text", "least"), [(LIGHT, 30), (PHOTONS, 20)], ids=["light", "photons"])
def test_scenes_that_are_pointed_to(text, least):
    rows = re.findall(r"^\| [^|]+ \| ([^|]+) \| `", text, flags=re.MULTILINE)
    assert len(rows) > least
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert {f"{name}.py" for name in named} <= {p.name for p in (ROOT / "scenes").glob("*.py")}


def test_pictures_are_shown_and_links_lead_somewhere():
    linked = set()
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        links = re.findall(r"\]\(([^):#]+)(?:#[\w-]+)?\)", page.read_text(encoding="utf-8"))
        linked |= {(page.parent / link).resolve() for link in links}
    assert {link for link in linked if not link.exists()} == set()
    pictures = {p for ending in ("png", "webp") for p in (ROOT / "docs").rglob(f"*.{ending}")}
    assert pictures <= linked


def test_the_version_is_stated_alike():
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.MULTILINE)
    assert cited is not None
    assert cited[1] == __version__
    assert f"## [{__version__}]" in (ROOT / "CHANGELOG.md").read_text("utf-8")


@pytest.mark.parametrize("module", [hybrid_rt, meshing], ids=lambda module: module.__name__)
def test_reference_has_every_public_name(module):
    pages = (ROOT / "docs" / "reference").glob("*.md")
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    documented = set(re.findall(r"\.\. auto(?:class|function):: (?:[\w.]+\.)?(\w+)", text))
    assert {name for name in module.__all__ if not name.startswith("__")} - documented == set()


def test_site_leads_to_every_page():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^[\w/]+$", index, re.MULTILINE))
    pages = {page.relative_to(ROOT / "docs") for page in (ROOT / "docs").rglob("*.md")}
    assert {page.with_suffix("").as_posix() for page in pages} - {"index"} == listed
