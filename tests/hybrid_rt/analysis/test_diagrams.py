"""Diagrams of studies."""

import math
import re
from xml.etree import ElementTree

import imageio.v3 as imageio
import pytest

from hybrid_rt.analysis.diagrams import Diagram, Line, Mark, as_svg, save, save_pdf


class TestDiagram:
    def mark(self, x, y, **more):
        return Mark((x, x, x), (y, y, y), **more)

    def test_words_and_marks_are_drawn(self, tmp_path):
        marks = [self.mark(10.0**k, 10.0 ** (-0.5 * k), label=f"n{k}") for k in range(5)]
        marks.append(self.mark(1e5, 1e-3, is_limit=True))
        diagram = Diagram(
            "t", "x", "y", [Line("half", marks)], ((-0.5, "noise"),), ("<floor>", 0.02), "n"
        )
        svg = as_svg(diagram)
        assert svg == as_svg(diagram)
        words = {text.text.strip() for text in ElementTree.fromstring(svg).iter() if text.text}
        assert words >= {"x", "y", "half", "noise", "<floor>", "n0", "n4"}
        save([diagram] * 3, tmp_path / "a.png")
        assert imageio.imread(tmp_path / "a.png").shape[:2] == (3 * 517, 924)

    def test_each_is_a_page_of_vectors_and_the_same_bytes_again(self, tmp_path):
        diagrams = [Diagram("t", "x", "y", [Line("l", [self.mark(1.0, 2.0)])])] * 2
        for name in ("a.pdf", "b.pdf"):
            save_pdf(diagrams, tmp_path / name)
        written = (tmp_path / "a.pdf").read_bytes()
        assert written == (tmp_path / "b.pdf").read_bytes()
        assert len(re.findall(rb"/Type /Page\b", written)) == 2
        assert b"/Subtype /Image" not in written

    @pytest.mark.parametrize("more", [0.0, 1e-16, 1e-15, 1e-13])
    def test_marks_that_rounding_alone_tells_apart_are_drawn(self, more):
        """Renders may take as long as each other: of such marks matplotlib draws no axis."""
        x = 0.0625
        marks = [self.mark(x, 1.0, label="a"), self.mark(x * (1.0 + more), 2.0, label="b")]
        assert "<svg" in as_svg(Diagram("t", "x", "y", [Line("l", marks)]))

    @pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
    def test_what_has_no_logarithm_is_refused(self, value):
        with pytest.raises(ValueError, match=rf"diagram 't' has the value {value}: pass"):
            Diagram("t", "x", "y", [Line("l", [self.mark(1.0, value)])])

    def test_nothing_to_draw_is_refused(self):
        with pytest.raises(ValueError, match="has no marks"):
            Diagram("t", "x", "y", [])
