"""What the documents point to exists."""

import re
from pathlib import Path

import pytest

import hybrid_rt
import meshing
from hybrid_rt._version import __version__

ROOT = Path(__file__).parents[1]
DOCS = sorted((ROOT / "docs").rglob("*.md"))


def test_tests_that_are_pointed_to():
    text = "".join(page.read_text(encoding="utf-8") for page in DOCS)
    for path, name in set(re.findall(r"`(?:tests/)?(\S+\.py)::(\w+)`", text)):
        assert f"def {name}(" in (ROOT / "tests" / path).read_text(encoding="utf-8")


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
    """All but appendices, which say ``orphan``: other pages link to them."""
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^[\w/]+$", index, re.MULTILINE))
    texts = {page: page.read_text(encoding="utf-8") for page in DOCS}
    appendices = {
        page for page, text in texts.items() if text.startswith("---\norphan: true\n---\n")
    }
    pages = {page.relative_to(ROOT / "docs") for page in set(DOCS) - appendices}
    assert {page.with_suffix("").as_posix() for page in pages} - {"index"} == listed
    assert all(any(f"({page.name})" in text for text in texts.values()) for page in appendices)
