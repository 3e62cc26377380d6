"""Sections 7.2 to 7.4 of the paper: main claims, and comparison with independent results, on a coarse mesh."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from meeframe.material import library_material
from meeframe.material.half_space import surface_compliance
from meeframe.study.reports.study import study_json
from meeframe.study.solve import solve_study

STUDIES = Path(__file__).parents[3] / "validation"
COARSE = (("divisions = 16", "divisions = 12"), ("rings = 7", "rings = 4"))


def load_claims():
    sys.path.insert(0, str(STUDIES / "orthotropic_claims"))
    try:
        return importlib.import_module("figures"), importlib.import_module("claims")
    finally:
        sys.path.pop(0)


figures, claims = load_claims()


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    """Return a function that solves a study of the three sections with 12 x 12 elements in the zone."""
    folder = tmp_path_factory.mktemp("orthotropic")

    def solved(name):
        (source,) = STUDIES.glob(f"orthotropic_*/{name}.toml")
        for file in (source, source.parent / "emii.toml"):
            text = file.read_text(encoding="utf-8")
            for fine, coarse in COARSE:
                text = text.replace(fine, coarse)
            (folder / file.name).write_text(text, encoding="utf-8")
        numbers = folder / f"{name}.json"
        numbers.write_text(study_json(solve_study(folder / source.name, folder / "cache")), encoding="utf-8")
        return figures.read_figure(numbers)

    return solved


def assert_claims(figure, differing=(), unresolved=()):
    all_claims = claims.claims(figure)
    assert all_claims
    for claim in all_claims:
        expected_verdicts = {"differs": differing, "not resolved": unresolved}
        expected = [
            verdict for verdict, named in expected_verdicts.items() if any(words in claim.paper for words in named)
        ]
        assert claim.verdict == (expected or ["holds"])[0], claim
        assert claim.as_explained or claim.verdict != "differs", claim


def test_magnetic_conduction_halves_the_force(figure):
    result = figure("fig-05")
    assert_claims(result)
    for panel, flux in zip(result.panels, ("charge", "magnetic_flux"), strict=True):
        assert np.all(np.diff(panel.quantities["force"]) < 0)
        assert np.all(np.diff(panel.quantities[flux]) > 0)
        assert panel.quantities[flux][-1] == pytest.approx(1.0, abs=1e-3)


def test_electric_conduction_does_not_affect_other_fields(figure):
    assert_claims(figure("fig-06"), differing=["all variables are clearly modified"])


def test_friction_increases_potentials_under_insulating_contact(figure):
    """An independent half-space solver gives +59 % electric, +33 % magnetic, EMCI force +1.6 %
    (docs/explanation/theory.md)."""
    result = figure("fig-07")
    assert_claims(result)
    insulating, conducting = (panel.quantities for panel in result.panels)
    assert insulating["max_electric_potential"][-1] == pytest.approx(1.59, abs=0.04)
    assert insulating["max_magnetic_potential"][-1] == pytest.approx(1.33, abs=0.02)
    assert conducting["force"][-1] == pytest.approx(1.016, abs=0.006)


def test_orthotropic_friction_affects_the_potentials(figure):
    assert_claims(figure("fig-09"))


def test_tangential_load(figure):
    """The maxima of the potentials move against the load: see the page and the next test."""
    result = figure("fig-10")
    unresolved = ["μ = 0.1: the stick zone decreases", "μ = 0.1: the stick zone moves"]
    assert_claims(result, differing=["moves in the direction of the load"], unresolved=unresolved)
    for panel, mu in zip(result.panels, (0.1, 0.6), strict=True):
        traction, pressure = (panel.quantities[name] @ panel.weights for name in ("traction_x", "pressure"))
        ratio = dict(zip(panel.runs, traction / (mu * pressure), strict=True))
        for run in ("0", "0.25", "0.5", "0.75", "0.9"):
            assert ratio[run] == pytest.approx(float(run), abs=1e-8)
        assert ratio["full slip"] == pytest.approx(1.0, abs=1e-6)
        assert abs(ratio["full stick"]) < 1e-6  # by symmetry
        assert panel.stick_area("full stick") == 1.0
        assert panel.stick_area("full slip") == 0.0


@pytest.mark.parametrize(("factor", "verdict"), [(1.05, "holds"), (0.85, "differs"), (1.15, "differs")])
def test_unaffected_quantities_do_not_change(factor, verdict):
    """The criterion of Fig. 7 (b) is the magnitude of the change, whatever its sign."""

    def panel(title, **ends):
        quantities = {name: np.array([1.0, end]) for name, end in ends.items()}
        return figures.Panel(title, ("0", "0.9"), np.array([0.0, 0.9]), quantities, np.array([]), np.array([]))

    insulating = panel("(a) EMII", force=1.1, max_electric_potential=1.6, max_magnetic_potential=1.3)
    conducting = panel("(b) EMCI", force=1.0, charge=factor, magnetic_flux=1.0)
    all_claims = claims.claims(figures.Figure("fig-07", "", "", (insulating, conducting), ()))
    assert all_claims[-1].verdict == verdict


@pytest.mark.parametrize(("rise", "explained"), [(0.98, True), (1.2, False), (0.8, False)])
def test_explanation_bounds_the_difference(rise, explained):
    """Fig. 7 at 1e-12 s/m: an independent half-space solver gives +102 %, the paper +65 %."""
    quantities = {"max_electric_potential": np.array([1.0, 1.0 + rise]), "max_magnetic_potential": np.array([1.0, 1.3])}
    panel = figures.Panel("1e-12 s/m", ("0", "0.9"), np.array([0.0, 0.9]), quantities, np.array([]), np.array([]))
    (claim,) = claims.claims(figures.Figure("fig-07-scales", "", "", (panel,), ()))
    assert claim.verdict == "differs"
    assert claim.as_explained is explained


@pytest.mark.parametrize("name", ["orthotropic-mee", "batio3-cofe2o4"])
@pytest.mark.parametrize("axis", [0, 1])
def test_surface_sinks_ahead_of_a_tangential_load(name, axis):
    """The odd part of the surface compliance determines where a load along an axis moves contact and potentials.

    Y exp(ikx)/k with an odd imaginary part i c gives a response with the sign of -c ahead of a point force.
    """
    compliance = surface_compliance(library_material(name).stiffness, (0, 0, 1), np.eye(3)[[axis]])[0]
    pressed = -compliance[2:, 2].real
    ahead = -compliance[2:, axis].imag
    assert np.all(ahead[1:] * pressed[1:] < 0), "the potentials of indentation are lowered ahead"
    assert ahead[0] < 0, "the surface sinks ahead, so that the contact moves back"


@pytest.mark.parametrize("name", ["fig-13", "fig-14"])
def test_direction_of_sliding_affects_all_fields(figure, name):
    result = figure(name)
    assert_claims(result)
    law = {"fig-13": (0.1, 0.6), "fig-14": (0.6, 0.1)}[name]
    for panel, angle in zip(result.panels, np.deg2rad([0.0, 45.0, 90.0]), strict=True):
        pressure = panel.of("pressure", "full slip")
        contact_fraction = pressure > 1e-3
        # the associated rule: the traction is M^2 g / |M g|, with g the direction of sliding
        slip = np.array([np.cos(angle), np.sin(angle)])
        expected = np.array(law) ** 2 * slip / np.linalg.norm(np.array(law) * slip)
        found_ratio = panel.of("tangential_traction", "full slip")[contact_fraction] / pressure[contact_fraction, None]
        np.testing.assert_allclose(found_ratio, np.broadcast_to(expected, found_ratio.shape), atol=0.01)
