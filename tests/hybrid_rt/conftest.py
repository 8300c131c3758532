"""What the tests of several rooms have in common."""

import pytest

# Here pictures are compared with each other and with closed forms.
OF_PICTURES = {"integrators", "lights", "textures"}


@pytest.fixture(autouse=True)
def few_photons_estimate_the_mean(request, monkeypatch):
    """Else 20 000 photons take most of a small render where the camera sees few; no pixel depends on them."""
    if OF_PICTURES & set(request.path.parts) and request.path.stem != "test_cross_check":
        from hybrid_rt.integrators.probes import cross_check

        monkeypatch.setattr(cross_check, "MOST_PHOTONS", cross_check.FEWEST_PHOTONS)
