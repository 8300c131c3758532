"""Which method a study names, and by which command."""

from dataclasses import replace

from hybrid_rt.analysis import answers
from hybrid_rt.analysis.advice import advise
from hybrid_rt.analysis.curves import Curve, Point, spread


class TestAnswer:
    """Methods that take 1 s for 10 passes of an error of 10 %, and variants of it."""

    @staticmethod
    def method(name, seconds, errors, flags="--integrator path"):
        points = [Point(10, spread(seconds), spread(errors), {"error_of_most": 0.05})]
        return Curve(name, flags, points, converges="--accuracy" not in flags)

    def advice(self, room, *curves, runs=2):
        reference = replace(room.reference, own_error=0.01)
        study = replace(room, reference=reference, curves=list(curves), runs=runs)
        return advise(study, 0.1, "a b.py"), study

    def test_a_mesh_is_not_named_where_a_dot_of_one_run_decides(self, room):
        """Certified hits met a dot in one run of two; what takes longer in all runs is no rival."""
        mesh = "--integrator path --accuracy mesh --tolerance 1"
        fast = self.method("mesh", [1.0, 1.01], [0.1, 0.1], mesh)
        slow = self.method("slow", [2.0, 2.1], [0.1, 0.1])
        dots = self.method("dots", [1.0, 1.05], [0.099, 0.5])
        assert self.advice(room, fast, slow)[0].headline.startswith("For 10 %: mesh, 10 passes")
        found, study = self.advice(room, fast, slow, dots)
        assert found.headline.startswith("For 10 %: dots, ")
        assert any(
            "do not tell it apart from mesh (1.0 s to 1.0 s), slow" in d for d in found.details
        )
        (words,) = answers.dots_answers(study, 0.1)
        assert "97 % of dots. So runs differ by a few dots" in words
        assert words.endswith("--target-trimmed 0.1 leaves these pixels out of all errors.")
        assert not answers.dots_answers(replace(study, trimmed=True), 0.1)

    def test_one_run_names_no_hits_without_proof(self, room):
        fast = self.method("mesh", [1.0], [0.1], "--integrator path --accuracy mesh")
        found, _ = self.advice(room, fast, self.method("slow", [2.0], [0.1]), runs=1)
        assert found.headline.startswith("For 10 %: slow, ")
        assert any(
            d.startswith("mesh would take 1.0 s, by one run, and its") for d in found.details
        )

    def test_the_command_for_an_integrator_of_the_script_names_none(self, room):
        own = self.method("mine", [1.0, 1.0], [0.1, 0.1], "--integrator mine")
        found, _ = self.advice(room, own)
        assert found.command.startswith("hybrid-rt render 'a b.py' --passes 10 --width 16 ")
        assert any("let it say INTEGRATOR = 'mine'" in d for d in found.details)
