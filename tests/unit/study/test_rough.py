"""The study of a rough surface: its quantities against closed forms, theories, limits, messages and dataset."""

import csv
import io
import json
from dataclasses import fields, replace

import numpy as np
import pytest
from meeframe_halfspace import SelfAffine

import meeframe
from meeframe.common.errors import CaseError
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.plugin.registry import load
from meeframe.study.rough.declare import declare, mean_response
from meeframe.study.rough.figures import contact_figure
from meeframe.study.rough.files import csv_text, dataset
from meeframe.study.rough.quantities import QUANTITIES, Contact, per_drop
from meeframe.study.rough.run import solve_rough
from meeframe.study.rough.theory import BUSH_GIBSON_THOMAS, PERSSON, bush_gibson_thomas_area, persson_area

YOUNG, POISSON, SIGMA, EPSILON = 120e9, 0.34, 5.8e7, 8.8541878128e-12
MODULUS = YOUNG / (1 - POISSON**2)
COPPER = {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": POISSON}
SELF_AFFINE = {
    "name": "self-affine",
    "period": "1 mm",
    "shortest": "0.25 mm",
    "hurst": 0.8,
    "rms_slope": 0.1,
    "seed": 3,
    "samples": 32,
}


def study(**keys):
    return declare({"surface": SELF_AFFINE, "material": COPPER, "pressures": ["1 GPa"], **keys}, load())


def wave(n=128, length=1e-3, amplitude=1e-6):
    """Return a wave along x with this amplitude, and the pressure that flattens it."""
    x, y = length * np.arange(n) / n, length / n * np.arange(4)
    heights = amplitude * np.cos(2 * np.pi * x / length)[:, None] + np.zeros(4)
    return meeframe.topography.HeightMap(x, y, heights, is_periodic=True), np.pi * MODULUS * amplitude / length


def test_wave_of_westergaard():
    """Area, gap, stiffness and conductance of a wave have closed forms (Johnson, Contact Mechanics, section 13.2).

    The contact is an array of strips of half width a with sin(pi a / l)^2 = p / p*. The resistance of a strip exceeds
    that of a uniform current by -l log(sin(pi a / l)) / (pi sigma) per area (Holm, Electric Contacts), and the
    stiffness follows from it, or from the mean gap.
    """
    surface, flat = wave()
    length, shares = 1e-3, np.array([0.1, 0.3, 0.6])
    checked = study(surface=surface, pressures=list(shares * flat), electrical_conductivity=SIGMA)
    result = solve_rough(checked)
    assert result.is_converged
    values = result.values
    np.testing.assert_allclose(values["area_fraction"], 2 / np.pi * np.arcsin(np.sqrt(shares)), atol=2 / 128)
    gap = 1e-6 - length * shares * flat / (np.pi * MODULUS) * (1 - np.log(shares))
    np.testing.assert_allclose(values["mean_gap"], gap, atol=2e-9)
    np.testing.assert_allclose(values["separation"], values["mean_gap"], atol=1e-15)
    conductance = 2 * np.pi * SIGMA / (length * -np.log(shares))
    np.testing.assert_allclose(values["conductance"], conductance, rtol=0.03)
    np.testing.assert_allclose(values["stiffness"], np.pi * MODULUS / (length * -np.log(shares)), rtol=0.03)


def hertz(n, radius=10e-3, width=1e-3, radii=(0.21e-3, 0.25e-3, 0.3e-3, 0.34e-3), stiffness=True):
    """Return the result of a sphere on a free half space, with the radii of its contact."""
    x = y = np.linspace(-width / 2, width / 2, n)
    ball = meeframe.topography.HeightMap(x, y, -(x[:, None] ** 2 + y**2) / (2 * radius))
    radii = np.array(radii)
    forces = 4 * MODULUS * radii**3 / (3 * radius)
    checked = study(surface=ball, pressures=list(forces / width**2), electrical_conductivity=SIGMA, stiffness=stiffness)
    return solve_rough(checked).values, radii, width**2


def test_sphere_of_hertz_and_holm():
    values, radii, area = hertz(65)
    np.testing.assert_allclose(values["area_fraction"] * area, np.pi * radii**2, rtol=0.03)
    np.testing.assert_allclose(values["approach"], radii**2 / 10e-3, rtol=1e-3)
    np.testing.assert_allclose(values["conductance"] * area, 4 * SIGMA * radii, rtol=0.02)
    np.testing.assert_allclose(values["stiffness"] * area, 2 * MODULUS * radii, rtol=0.02)


@pytest.mark.full
def test_conductance_of_a_spot_converges():
    """Root mean square errors over several radii decrease with more than first order, as the spot is resolved to
    nodes."""
    errors = []
    for n in (33, 65, 129):
        values, radii, area = hertz(n, radii=np.linspace(0.2e-3, 0.35e-3, 6), stiffness=False)
        errors.append(np.sqrt(np.mean((values["conductance"] * area / (4 * SIGMA * radii) - 1) ** 2)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 4e-3
    assert orders.mean() > 1.0


def test_conductance_and_stiffness_agree_by_barber():
    """The currents and the differences of two loads do not know each other, nor the response to a mean load."""
    values = solve_rough(
        study(pressures=["0.5 GPa", "2 GPa"], electrical_conductivity="58 MS/m", electric_potential="2 V")
    ).values
    np.testing.assert_allclose(values["conductance"], 2 * SIGMA / MODULUS * values["stiffness"], rtol=1e-3)
    np.testing.assert_allclose(values["capacitance"], EPSILON / SIGMA * values["conductance"], rtol=1e-9)
    # of the same voltage, some is lost in the body
    assert (values["charge_density"] > 0.0).all()
    assert (values["charge_density"] < 2.0 * values["capacitance"]).all()


def test_film_adds_its_resistance():
    """On full contact the current is uniform, and the conductance is that of the film."""
    surface, flat = wave(32)
    keys = {"electrical_conductivity": SIGMA, "contact_conductance": "30 GS/m^2", "stiffness": False}
    full, part = (
        solve_rough(study(surface=surface, pressures=[p], **keys)).values["conductance"][0]
        for p in (1.5 * flat, 0.3 * flat)
    )
    assert full == pytest.approx(3e10, rel=1e-6)
    assert part < 0.5 * full


def test_films_of_charges_and_currents_differ():
    """On full contact, capacitance and conductance are those of their films, each with its unit, in one study."""
    surface, flat = wave(32)
    charges = {"electric": {"name": "step", "kappa": "2 uF/m^2"}}
    currents = {"name": "power-law", "reference_conductivity": "5 GS/m^2", "reference_pressure": flat, "exponent": 1.0}
    keys = {"electric_potential": "2 V", "electrical_conductivity": SIGMA, "stiffness": False}
    checked = study(surface=surface, pressures=[2.0 * flat], conductivity=charges, contact_conductance=currents, **keys)
    values = solve_rough(checked).values
    assert values["capacitance"][0] == pytest.approx(2e-6, rel=1e-6)
    # the pressure is 2 + cos, with a mean of 2, and the body conducts far better than the film
    assert values["conductance"][0] == pytest.approx(10e9, rel=0.01)
    perfect = study(
        surface=surface, pressures=[2.0 * flat], conductivity=charges, contact_conductance="inf S/m^2", **keys
    )
    assert solve_rough(perfect).values["conductance"][0] == np.inf


def test_films_of_currents_in_all_forms():
    law = meeframe.StepConductivity(3e10)
    forms = (3e10, "30 GS/m^2", {"name": "step", "kappa": "30 GS/m^2"}, law)
    laws = [study(electrical_conductivity=SIGMA, contact_conductance=form).current_law for form in forms]
    assert laws == [law] * 4
    none = solve_rough(study(electrical_conductivity=SIGMA, contact_conductance="insulating", stiffness=False))
    assert none.values["conductance"][0] == pytest.approx(0.0, abs=1e-3)


def test_piezoelectric_charge_and_capacitance():
    """The charge of an earthed surface is proportional to the load, and a voltage adds one that is independent of it.

    Eliminating the contact gives the ratio of capacitance to stiffness from the point response xi of the material.
    """
    xi = axisymmetric_compliance(library_material("pzt-4").stiffness)[:2, :2]
    inverse = np.linalg.inv(xi)
    charges = [
        solve_rough(study(material={"name": "pzt-4"}, pressures=["0.3 GPa"], electric_potential=volt)).values
        for volt in (0.0, 100.0, -250.0)
    ]
    assert "capacitance" not in charges[0]
    ratio = charges[0]["charge_density"][0] / 0.3e9
    assert ratio == pytest.approx(inverse[1, 0] / inverse[0, 0], rel=1e-6)
    first, second = (values["capacitance"][0] for values in charges[1:])
    assert first == pytest.approx(second, rel=1e-6)
    assert first / charges[1]["stiffness"][0] == pytest.approx(abs(1 / xi[1, 1]) / inverse[0, 0], rel=1e-3)


def test_hardness_raises_the_area():
    keys = {"pressures": ["0.5 GPa", "1.5 GPa"], "stiffness": False}
    hard = solve_rough(study(**keys)).values
    soft = solve_rough(study(contact={"law": {"name": "hardness", "hardness": "3 GPa"}}, **keys)).values
    assert (soft["area_fraction"] > hard["area_fraction"]).all()
    assert (soft["area_fraction"] >= np.array([0.5, 1.5]) / 3).all()
    assert (soft["separation"] < soft["mean_gap"]).all()
    np.testing.assert_allclose(soft["max_pressure"], 3e9)


def test_stiffness_under_a_hardness_follows_the_curve():
    """Between two pressures, the geometric mean of the stiffnesses is near the slope of the chord."""
    pressures = np.array([0.2, 0.25, 0.4, 0.45, 0.6, 0.65]) * 1e9
    law = {"name": "hardness", "hardness": "1 GPa"}
    fine = SELF_AFFINE | {"samples": 64}
    values = solve_rough(study(surface=fine, pressures=pressures.tolist(), contact={"law": law})).values
    chords = (np.diff(pressures) / -np.diff(values["separation"]))[::2]
    np.testing.assert_allclose(np.sqrt(values["stiffness"][::2] * values["stiffness"][1::2]), chords, rtol=0.1)


def test_theories_have_their_slopes():
    small = np.array([1e-5])
    assert persson_area(small) / small == pytest.approx(PERSSON, rel=1e-8)
    assert bush_gibson_thomas_area(small) / small == pytest.approx(BUSH_GIBSON_THOMAS)
    assert np.sqrt(8 / np.pi) == PERSSON < BUSH_GIBSON_THOMAS == np.sqrt(2 * np.pi)
    # the probability of pressures above zero in a normal distribution reflected at zero
    p = np.linspace(0.1, 1.5, 5)
    stress = np.linspace(0.0, 12.0, 20001)
    deviation = 0.5
    density = np.exp(-((stress - p[:, None]) ** 2) / (2 * deviation**2)) - np.exp(
        -((stress + p[:, None]) ** 2) / (2 * deviation**2)
    )
    area = np.trapezoid(density, stress, axis=1) / (deviation * np.sqrt(2 * np.pi))
    np.testing.assert_allclose(persson_area(p), area, atol=1e-7)


def test_moduli_of_materials():
    modulus, permittivity = mean_response(meeframe.Material.isotropic(YOUNG, POISSON, 3e-9))
    assert modulus == pytest.approx(MODULUS, rel=1e-12)
    assert permittivity == pytest.approx(3e-9, rel=1e-12)


def test_default_pressures_scale_with_the_surface():
    checked = declare({"surface": SELF_AFFINE, "material": COPPER}, load())
    relative = checked.pressures / (MODULUS * 0.1)
    assert relative[0] == pytest.approx(0.01, rel=1e-5)
    assert relative[-1] == pytest.approx(0.3, rel=1e-5)
    linear = study(pressures={"from": "1 MPa", "to": "3 MPa", "count": 3, "scale": "linear"})
    np.testing.assert_allclose(linear.pressures, [1e6, 2e6, 3e6])


def test_samples_resample_the_surface():
    checked = study(samples=48)
    assert checked.surface.shape == (48, 48)
    assert checked.statistics.rms_slope_spectrum == pytest.approx(0.1, rel=1e-9)
    assert len(checked.case.body.mesh.points) >= 48**2
    free = study(periodic=False, samples=20)
    assert not free.surface.is_periodic


def test_interruption_keeps_finished_pressures():
    calls = []

    def progress(stage, fraction):
        calls.append((stage, fraction))
        if stage == "pressures" and fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(meeframe.Interrupted) as caught:
        solve_rough(study(pressures=["0.5 GPa", "1 GPa", "1.5 GPa"]), progress)
    result = caught.value.result
    assert result.status == ("converged",)
    assert not result.is_converged
    assert len(result.values["area_fraction"]) == len(result.pressures) == 1


def test_dataset_and_table_hold_the_same():
    result = solve_rough(study(pressures=["0.5 GPa", "1 GPa"], title="Test"))
    data = dataset(result)
    assert data.attrs["title"] == "Test"
    assert json.loads(data.attrs["study"])["material"] == COPPER
    assert data.attrs["contact_modulus"] == pytest.approx(MODULUS)
    assert data.area_fraction.attrs["units"] == "1"
    rows = list(csv.DictReader(io.StringIO(csv_text(result))))
    np.testing.assert_allclose([float(row["pressure [Pa]"]) for row in rows], data.pressure)
    np.testing.assert_allclose([float(row["mean_gap [m]"]) for row in rows], data.mean_gap)
    assert [row["status"] for row in rows] == ["converged"] * 2
    total = float(data.nodal_pressure.mean())
    assert total == pytest.approx(1e9, rel=1e-8)
    touching = data.nodal_pressure > 0.0
    assert float(data.height.where(touching).min()) > float(data.height.quantile(1.0 - 2.0 * touching.mean()))


@pytest.mark.full
def test_python_function(tmp_path):
    data = meeframe.rough(wave(32)[0], "steel", ["20 MPa"], tmp_path / "out", stiffness=False)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "rough.h5", "rough.csv", "surface.json", "rough.png", "surface.png"
    }  # fmt: skip
    assert "stiffness" not in data
    capped = meeframe.rough(
        wave(32)[0], "steel", ["20 MPa"], contact=meeframe.law("hardness", hardness="50 MPa"), stiffness=False
    )
    assert float(capped.max_pressure[0]) <= 50e6 * (1 + 1e-12)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"pressures": ["2 GPa", "1 GPa"]}, "larger than the one before"),
        ({"pressures": []}, "at least one"),
        ({"pressures": ["1 mm"]}, r"^pressures\[1\] = '1 mm': has the wrong unit"),
        ({"pressures": [1e9, float("nan")]}, r"^pressures\[2\] = nan: is not a number"),
        ({"pressures": "1 mm"}, r"^pressures = '1 mm': has the wrong unit; .*, a list of them, or a range"),
        ({"pressures": 0}, r"^pressures = 0: must be > 0"),
        ({"pressures": {"from": "1 GPa", "to": "2 GPa", "count": 1}}, r"^pressures\.count = 1: "),
        ({"pressures": {"from": "1 GPa", "to": "2 GPa", "count": 20000}}, r"^pressures\.count = 20000: .* 10000"),
        ({"pressures": {"from": "1 m"}}, r"^pressures\.from = '1 m': has the wrong unit"),
        ({"pressures": {"to": "1 GPa", "upto": 1}}, r"^pressures\.upto = 1: unknown key"),
        ({"pressures": {"from": "1000 GPa"}}, r"^pressures\.from = 1e\+12: must be < .*e\+09 Pa, the default of to$"),
        ({"pressures": {"to": "1 kPa"}}, r"^pressures\.to = 1000\.0: must be > .*e\+08 Pa, the default of from$"),
        (
            {"pressures": {"from": "2 GPa", "to": "1 GPa"}},
            r"^pressures\.to = 1000000000\.0: must be > 2e\+09 Pa, the value of from$",
        ),
        ({"surface": {"name": "sphere", "radius": 1.0}}, "surface: Sphere is not known as heights on a grid"),
        ({"surface": {"name": "self-affine"}}, r"surface.period: missing"),
        ({"surface": {"name": "ridges"}}, r"surface.name.*ridges"),
        ({"material": {"name": "stel"}}, r"material.*steel"),
        ({"contact": {"law": "signorni"}}, r"contact.law.*signorini"),
        ({"formulation": {"name": "dense-bem"}}, "half-space"),
        ({"formulation": {"periodic": True}}, "the key periodic of the study"),
        ({"formulation": {"density": "linear"}}, r"formulation.density"),
        ({"samples": 3}, r"samples"),
        ({"electric_potential": "1 A"}, r"electric_potential.*unit"),
        (
            {"electrical_conductivity": SIGMA, "conductivity": {"electric": {"name": "step", "kappa": 3e10}}},
            r"^conductivity\.electric: for currents it is now called 'contact_conductance' \[S/m\^2\]; allowed ",
        ),
        ({"contact_conductance": 3e10}, r"^contact_conductance: needs electrical_conductivity"),
        (
            {"electrical_conductivity": SIGMA, "contact_conductance": "1 uF/m^2"},
            r"^contact_conductance = '1 uF/m\^2': has the wrong unit; expected .* S/m\^2 .*, or a conductivity law",
        ),
        ({"electrical_conductivity": SIGMA, "contact_conductance": -1}, r"^contact_conductance = -1: must be >= 0"),
        (
            {"electrical_conductivity": SIGMA, "contact_conductance": {"name": "step", "kappa": "1 uF/m^2"}},
            r"^contact_conductance\.kappa = '1 uF/m\^2': has the wrong unit; expected a number in S/m\^2 ",
        ),
        (
            {"electric_potential": 1.0, "conductivity": {"electric": {"name": "step", "kappa": "1e12 S/m^2"}}},
            r"^conductivity\.electric\.kappa = '1e12 S/m\^2': has the wrong unit; expected a number in F/m\^2 ",
        ),
        (
            {"electrical_conductivity": SIGMA, "contact_conductance": {"name": "stepp"}},
            r"^contact_conductance\.name: unknown conductivity law 'stepp'; did you mean 'step'",
        ),
        ({"electrical_conductivity": "1 S/m^2"}, r"^electrical_conductivity = '1 S/m\^2': has the wrong unit"),
        ({"ambient": 1}, r"ambient.*unknown key"),
    ],
)
def test_messages_name_keys(keys, message):
    with pytest.raises(CaseError, match=message):
        study(**keys)


@pytest.mark.parametrize("n", [8, 64])
@pytest.mark.parametrize("height", [1.0, 1e-6, 0.0])
@pytest.mark.parametrize("tilt", [0.0, 0.3])
@pytest.mark.parametrize("periodic", [False, True])
def test_flat_surfaces_are_refused(n, height, tilt, periodic):
    x = 1e-6 * np.arange(n)
    surface = meeframe.topography.HeightMap(x, x, height * np.ones((n, n)) + (0.0 if periodic else tilt) * x)
    with pytest.raises(CaseError, match="surface: is flat"):
        study(surface=surface, periodic=periodic)


def test_roughness_far_above_its_reference_is_not_flat():
    """Heights of some nanometres on an offset of a centimetre are no round-off."""
    x = 1e-6 * np.arange(32)
    heights = 1e-9 * np.random.default_rng(0).standard_normal((32, 32))
    assert study(surface=meeframe.topography.HeightMap(x, x, 1e-2 + heights)).slope == pytest.approx(2e-3, rel=0.1)


def test_missing_heights_name_the_surface():
    surface, _ = wave(8)
    surface.heights[1, 2] = np.nan
    with pytest.raises(CaseError, match=r"^surface: .*1 of 32 heights are missing"):
        study(surface=surface)


FULL = {"electrical_conductivity": SIGMA, "electric_potential": "2 V"}


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("samples", [32, 64])
@pytest.mark.parametrize("material", [COPPER, {"name": "pzt-4"}])
def test_full_contact_has_no_resistance(samples, material):
    """Beyond the pressure that flattens all waves, drops and closings are round-off."""
    surface, pressures = {**SELF_AFFINE, "samples": samples}, ["0.5 GPa", "40 GPa", "200 GPa", "1000 GPa"]
    result = solve_rough(study(surface=surface, material=material, pressures=pressures, **FULL))
    assert result.is_converged
    np.testing.assert_allclose(result.values["area_fraction"][1:], 1.0)
    for name in ("conductance", "capacitance", "stiffness"):
        assert 0.0 < result.values[name][0] < np.inf
        assert (result.values[name][1:] == np.inf).all()


def test_films_resist_in_full_contact():
    """The stiffness is infinite, but not the conductance of a film."""
    keys = {"electrical_conductivity": SIGMA, "contact_conductance": 3e10}
    values = solve_rough(study(pressures=["100 GPa"], **keys)).values
    assert values["stiffness"][0] == np.inf
    assert values["conductance"][0] == pytest.approx(3e10, rel=1e-6)


def test_infinite_values_are_written_and_not_drawn():
    result = solve_rough(study(pressures=["0.5 GPa", "1000 GPa"], **FULL))
    table = csv_text(result).splitlines()
    assert table[2].count(",inf") == 3
    panels = {axes.get_ylabel().split(" [")[0]: axes for axes in contact_figure(result).axes}
    for name in ("conductance", "capacitance", "stiffness"):
        label = QUANTITIES[name].label
        for line in panels[label].lines:
            assert np.isnan(line.get_ydata()[1])
            assert np.isfinite(line.get_ydata()[0])


def crosses(**keys):
    checked = study(pressures=["0.5 GPa", "1 GPa"], electrical_conductivity=SIGMA, **keys)
    labels = [line.get_label() for axes in contact_figure(solve_rough(checked)).axes for line in axes.lines]
    return sum(str(label).startswith("from the stiffness") for label in labels)


@pytest.mark.full
def test_barber_is_drawn_where_it_holds():
    assert crosses() == 1
    assert crosses(contact_conductance={"name": "step", "kappa": float("inf")}) == 1
    assert crosses(contact_conductance=3e10) == 0
    assert crosses(contact={"law": {"name": "hardness", "hardness": "30 GPa"}}) == 0
    assert crosses(material={"name": "pzt-4"}) == 0


HARD = {"law": {"name": "hardness", "hardness": "0.8 GPa"}}


@pytest.mark.parametrize("pressures", [["0.5 GPa", "0.8 GPa"], {"to": "1 GPa"}, "900 MPa"])
def test_pressures_from_the_hardness_on_are_refused(pressures):
    with pytest.raises(
        CaseError, match=r"^pressures: .* Pa; allowed: less than the hardness of the contact law, 8e\+08 Pa"
    ):
        study(contact=HARD, pressures=pressures)


def test_default_pressures_are_below_the_hardness():
    checked = declare({"surface": SELF_AFFINE, "material": COPPER, "contact": HARD}, load())
    assert checked.pressures[-1] == pytest.approx(0.72e9)
    assert checked.pressures[0] == pytest.approx(0.024e9)
    assert len(checked.pressures) == 8


def test_stiffness_close_to_the_hardness():
    result = solve_rough(study(contact=HARD, pressures=["0.79 GPa", "0.79999 GPa"]))
    assert result.is_converged
    assert (result.values["stiffness"] > 0.0).all()


def test_pressures_without_convergence_have_no_quantities():
    result = solve_rough(
        study(pressures=["0.5 GPa", "1 GPa"], electrical_conductivity=SIGMA, solver={"max_iterations": 1})
    )
    assert not result.is_converged
    for name, values in result.values.items():
        assert np.isnan(values).all() == (name not in ("persson_area", "bush_gibson_thomas_area"))
    assert np.isnan(result.nodal_pressure).all()
    assert len(contact_figure(result).axes) > 4


def test_ranges_of_pressures_have_defaults():
    default = declare({"surface": SELF_AFFINE, "material": COPPER}, load()).pressures
    few = study(pressures={"count": 3}).pressures
    assert len(few) == 3
    np.testing.assert_allclose(few[[0, -1]], default[[0, -1]])
    np.testing.assert_allclose(study(pressures={"to": "1 GPa", "count": 2}).pressures, [default[0], 1e9])
    np.testing.assert_array_equal(study(pressures="5 MPa").pressures, [5e6])
    np.testing.assert_array_equal(study(pressures=1e9).pressures, [1e9])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"samples": 10**6}, "samples = 1000000: a run with 2000000 nodes needs at least 1.04 GB"),
        ({"samples": 10**30}, f"samples = {10**30}: a run with {2 * 10**30} nodes needs at least 7.70e+23 GB"),
        ({"samples": 10**400}, f"samples = {10**400}: a run with {2 * 10**400} nodes needs at least 7.70e+393 GB"),
        (
            {"surface": {**SELF_AFFINE, "samples": 9999}},
            "surface.samples = 9999: a run with 99980001 nodes needs at least 38.8 GB",
        ),
    ],
)
def test_samples_beyond_the_memory_are_refused_before_they_are_made(monkeypatch, keys, message):
    monkeypatch.setattr("meeframe.mesh.generators.usable_memory", lambda: 500_000_000)
    end = "; this process may use 0.5 GB; allowed: about 772 x 772 nodes"
    with pytest.raises(meeframe.CaseError) as caught:
        study(**keys)
    assert str(caught.value) == message + end


def test_capacitance_is_unknown_where_the_reference_is():
    names = [field.name for field in fields(Contact)]
    full, failed = (Contact(**dict.fromkeys(names, value)) for value in (0.0, np.nan))
    assert np.isnan(per_drop(full, failed, has_drop=False))
    assert np.isnan(per_drop(failed, full, has_drop=False))
    assert per_drop(full, full, has_drop=False) == np.inf


def test_implausible_surfaces_are_warned_of():
    assert study().warnings == ()
    x = 1e-6 * np.arange(32)
    rough = np.random.default_rng(0).standard_normal((32, 32))
    in_nanometres = meeframe.topography.HeightMap(x, x, 20.0 * rough)
    (steep,) = study(surface=in_nanometres).warnings
    assert "slope" in steep
    assert "another unit" in steep
    assert study(surface=meeframe.topography.HeightMap(x, x, 2e-8 * rough), periodic=True).warnings == ()
    tilted = meeframe.topography.HeightMap(x, x, 2e-9 * rough + 0.02 * x[:, None], is_periodic=True)
    (jump,) = study(surface=tilted).warnings
    assert "jumps" in jump
    assert "along x" in jump
    with pytest.warns(UserWarning, match="along x"):
        meeframe.rough(tilted, COPPER, "10 MPa", stiffness=False)


def test_slope_of_theories_is_that_of_the_map():
    """The slope of a free map is that of its heights about the mean plane, which a window would change."""
    whole = SelfAffine(1e-3, shortest=1e-3 / 8, hurst=0.8, rms_slope=0.1, samples=64, seed=2).topography()
    part = meeframe.topography.HeightMap(whole.x[:40], whole.y[:40], whole.heights[:40, :40])
    checked = declare({"surface": part, "material": COPPER}, load())
    assert checked.slope == pytest.approx(meeframe.topography.detrend(part).rms_slope, rel=1e-12)
    assert checked.pressures[-1] == pytest.approx(0.3 * MODULUS * checked.slope, rel=1e-5)
    tilted = replace(part, heights=part.heights + 0.2 * part.x[:, None])
    assert study(surface=tilted).slope == pytest.approx(checked.slope, rel=1e-9)
    assert study(surface=whole).slope == study(surface=whole).statistics.rms_slope_spectrum


@pytest.mark.full
@pytest.mark.parametrize("shape", [(2, 64), (64, 2), (2, 2)])
def test_narrow_maps(shape, tmp_path):
    """A map without inner points has no curvature by differences; JSON has null in its place."""
    x, y = (1e-6 * np.arange(count) for count in shape)
    heights = 1e-8 * np.random.default_rng(1).standard_normal(shape)
    meeframe.rough(meeframe.topography.HeightMap(x, y, heights), COPPER, "1 MPa", tmp_path, stiffness=False)
    text = (tmp_path / "surface.json").read_text()
    assert json.loads(text, parse_constant=lambda name: pytest.fail(name))["rms_curvature"] is None
