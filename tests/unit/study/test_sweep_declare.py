"""Test study files of sweeps: points, and messages."""

import re
from pathlib import Path

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.results.sweep_files import write_sweep
from meeframe.results.sweep_records import SweepResult
from meeframe.study.declare import checked
from meeframe.study.sweep.declare import SweepTable

STUDY = """
case = "case.toml"
set = { "solver.tolerance" = 1e-8 }

[axes]
"contact.law.mu" = [0.0, 0.3, inf]

[axes.load]
light = { "steps[1].approach" = "10 um" }
heavy = { "steps[1].approach" = "20 um", "solver.tolerance" = 1e-6 }

[[plots]]
quantities = ["normal_force"]
x = "load"
at = { "contact.law.mu" = 0.3 }
"""


@pytest.fixture
def read(tmp_path):
    def read(text):
        path = tmp_path / "study.toml"
        path.write_text(text, encoding="utf-8")
        return checked(SweepTable, path)

    return read


def axis_of(study):
    ((axis, changes),) = study.varied()
    return axis, changes


def test_all_combinations_with_last_axis_fastest(read):
    study = read(STUDY)
    computed = list(study.changes())
    assert [label for label, _ in computed][:3] == [
        "contact.law.mu = 0, load = light",
        "contact.law.mu = 0, load = heavy",
        "contact.law.mu = 0.3, load = light",
    ]
    assert computed[3][1] == {"solver.tolerance": 1e-6, "contact.law.mu": 0.3, "steps[1].approach": "20 um"}
    mu, load = study.result_axes()
    np.testing.assert_array_equal(mu.values, [0.0, 0.3, np.inf])
    assert (load.labels, load.values) == (("light", "heavy"), None)


@pytest.mark.parametrize(
    ("values", "expected", "unit"),
    [
        ('["10 um", 2e-5]', [1e-5, 2e-5], "m"),
        ('["90 deg", "180 deg"]', [np.pi / 2, np.pi], "rad"),
        ('["5 mm/m", "180 deg"]', [5e-3, np.pi], "rad"),
        ('["5 N", "2 kN"]', [5.0, 2e3], "N"),
        ('["5 MPa", "2 N/mm^2"]', [5e6, 2e6], "Pa"),
        ('["1 kV", "2 kJ/C"]', [1e3, 2e3], "V"),
        ('["5 nC"]', [5e-9], "C"),
        ('["5 mWb"]', [5e-3], "Wb"),
        ('["5 mA"]', [5e-3], "A"),
        ('["5 N mm"]', [5e-3], "N m"),
        ('["2 mm^2"]', [2e-6], "m^2"),
        ('["3 Pa/m"]', [3.0], "kg/m^2/s^2"),
        ("{ from = 0.0, to = 1.0, count = 3 }", [0.0, 0.5, 1.0], ""),
        ('{ from = 1e-3, to = 10, count = 5, scale = "log" }', [1e-3, 1e-2, 0.1, 1.0, 10.0], ""),
        ('["signorini", { name = "isotropic-coulomb", mu = 0.3 }]', None, ""),
        ("[true, false]", None, ""),
    ],
)
def test_values_of_an_axis(read, values, expected, unit):
    axis, changes = axis_of(read(f'case = "c.toml"\n[axes]\n"some.key" = {values}'))
    assert axis.unit == unit
    assert [*changes[0]] == ["some.key"]
    assert len(changes) == len(axis.labels)
    if expected is None:
        assert axis.values is None
    else:
        np.testing.assert_allclose(axis.values, expected, rtol=1e-13)


def test_longer_range_contains_the_same_values(read):
    text = 'case = "c.toml"\n[axes]\nmu = {{ from = 1e-5, to = {}, count = {} }}'
    (short, _), (long, _) = (axis_of(read(text.format(*ends))) for ends in (("3e-5", 3), ("8e-5", 8)))
    assert short.labels == long.labels[:3]
    np.testing.assert_array_equal(short.values, long.values[:3])


def test_keys_that_change_together(read):
    text = 'case = "c.toml"\n[axes.size]\n"mesh.divisions" = [4, 8]\n"mesh.rings" = [{}, 3]'
    axis, changes = axis_of(read(text.format(2)))
    np.testing.assert_array_equal(axis.values, [4, 8])
    assert changes == ({"mesh.divisions": 4, "mesh.rings": 2}, {"mesh.divisions": 8, "mesh.rings": 3})
    axis, _ = axis_of(read(text.replace("[4, 8]", "[4, 4]").format(2)))
    assert (axis.labels, axis.values) == (("4, 2", "4, 3"), None), "told apart by both"


def test_nearly_equal_values_are_distinguished(read):
    study = read('case = "c.toml"\naxes = { mu = [0.1, 0.1000000001, 0.2] }')
    axis, changes = axis_of(study)
    assert axis.labels == ("0.1", "0.1000000001", "0.2")
    np.testing.assert_array_equal(axis.values, [0.1, 0.1000000001, 0.2])
    assert [change["mu"] for change in changes] == [0.1, 0.1000000001, 0.2]


def test_values_of_at_in_plots(read):
    text = """
        case = "c.toml"
        axes = { mu = [0.1, 0.1000000001], depth = [1, 2] }
        plots = [{ quantities = ["normal_force"], at = { mu = 0.1000000001 } }]
    """
    study = read(text)
    plot = study.plots[0].over(study.result_axes())
    assert plot.at == {"mu": "0.1000000001"}
    assert [axis and axis.name for axis in plot.plot_axes(study.result_axes())] == ["depth", None]


def test_single_points(read):
    points = '[[points]]\nlabel = "a"\nvalue = 1\n[[points]]\nlabel = "b"\nvalue = 2\nset = { "solver" = "auto" }\n'
    (axis,) = read(f'case = "c.toml"\n{points}').result_axes()
    assert (axis.name, axis.labels, axis.values.tolist()) == ("point", ("a", "b"), [1.0, 2.0])
    (axis,) = read(f'case = "c.toml"\naxes = {{ mu = [0, 1] }}\n{points}').result_axes()
    assert (axis.labels, axis.values) == (("mu = 0", "mu = 1", "a", "b"), None)


WRONG = {
    "unknown": (('case = "case.toml"', 'case = "case.toml"\naxis = 1'), "axis = 1: unknown key; did you mean 'axes'?"),
    "axes.load": (('light = { "steps[1].approach" = "10 um" }', "light = 3"), "axes.load: allowed: a list of values"),
    "lengths": (
        ("[axes.load]", "[axes.a]\nx = [1, 2]\ny = [1]\n[axes.load]"),
        "axes.a: allowed: non-empty lists of equal length", "y has 1",
    ),
    "empty": (("[0.0, 0.3, inf]", "[]"), "axes.contact.law.mu: allowed: non-empty lists of equal length"),
    "twice": (("[0.0, 0.3, inf]", "[0.3, 0.3]"), "axes.contact.law.mu: values: '0.3' is given twice"),
    "count": (("[0.0, 0.3, inf]", "{ from = 0, to = 1, count = 1 }"), "count = 1: allowed: a whole number from 2"),
    "ends": (("[0.0, 0.3, inf]", "{ from = 0, count = 3 }"), "from = 0, to = None: allowed: two finite numbers"),
    "log": (
        ("[0.0, 0.3, inf]", '{ from = 0, to = 1, count = 3, scale = "log" }'), "allowed with scale = 'log': positive"
    ),
    "spacing": (
        ("[0.0, 0.3, inf]", '{ from = 0, to = 1, count = 3, scale = "cubic" }'), "scale = 'cubic': allowed: linear, log"
    ),
    "spacings": (
        ("[0.0, 0.3, inf]", '{ from = 0, to = 1, count = 3, scale = ["log"] }'),
        "scale = ['log']: allowed: linear, log",
    ),
    "range": (("[0.0, 0.3, inf]", "{ from = 0, to = 1, steps = 3 }"), "unknown key 'steps'; allowed: count, from"),
    "range of a name": (
        ("[axes.load]", '[axes.a]\n"indenter.radius" = { from = 0.1, count = 3 }\n[axes.load]'),
        "axes.a: from = 0.1, to = None: allowed: two finite numbers",
    ),
    "key": (('"contact.law.mu" = [', '"contact..mu" = ['), "'contact..mu' is not a key of a case file"),
    "name": (("[axes.load]", "[axes.approach]"), "axes: 'approach' is reserved in sweep.h5"),
    "quantity": (
        ('["normal_force"]', '["normal_farce"]'),
        "plots[1].quantities: unknown quantity 'normal_farce'; did you mean 'normal_force'?",
    ),
    "axis": (('x = "load"', 'x = "lode"'), "plots[1].x: unknown axis 'lode'; did you mean 'load'?"),
    "at": (('"contact.law.mu" = 0.3 }', '"contact.law.mu" = 0.4 }'), "plots[1].at.contact.law.mu: unknown value '0.4'"),
    "fields": (
        ("[axes]", 'fields = ["pressures"]\n[axes]'), "fields: unknown field 'pressures'; did you mean 'pressure'?"
    ),
    "renamed field": (
        ("[axes]", 'fields = ["closed"]\n[axes]'), "unknown field 'closed'; it is now called 'contact_fraction', "
    ),
    "no case": (('case = "case.toml"', ""), "case: missing key"),
    "nul": (('"case.toml"', '"ca\\u0000se.toml"'), "case = 'ca\\x00se.toml': contains the character NUL"),
    "nul in a value": (("[0.0, 0.3, inf]", '["a\\u0000"]'), "axes.contact.law.mu: 'a\\x00' contains the character NUL"),
    "dot": (("[axes.load]", '[axes."."]'), "axes: '.' is reserved in sweep.h5"),
    "dots": (("[axes.load]", '[axes.".."]'), "axes: '..' is reserved in sweep.h5"),
    "same axis": (('x = "load"\nat = { "contact.law.mu" = 0.3 }', 'x = "load"\nlines = "load"'),
        "plots[1].x and lines are both 'load'; allowed: two axes"),
    "x in at": (('at = { "contact.law.mu" = 0.3 }', 'at = { load = "light" }'),
        "plots[1].at.load: the plot already uses this axis; allowed: other axes"),
    "lines in at": (('x = "load"', 'lines = "contact.law.mu"'),
        "plots[1].at.contact.law.mu: the plot already uses this axis"),
    "log over zero": (('x = "load"\nat = { "contact.law.mu" = 0.3 }', 'scale = "log"\nat = { load = "light" }'),
        "plots[1].scale = 'log': needs positive numbers; contact.law.mu has 0, 0.3, inf"),
    "log over names": (('x = "load"', 'x = "load"\nscale = "log"'),
        "plots[1].scale = 'log': needs positive numbers"),
    "map of one": (('x = "load"', 'kind = "map"'), "plots[1].kind = 'map': needs two axes"),
    "same key": (('light = { "steps[1].approach" = "10 um" }', 'light = { "contact.law.mu" = 0.1 }'),
        "axes: 'contact.law.mu' changes contact.law.mu and 'load' changes contact.law.mu: one would override the"),
    "key in a table": (('light = { "steps[1].approach" = "10 um" }', 'light = { "contact.law" = "signorini" }'),
        "axes: 'contact.law.mu' changes contact.law.mu and 'load' changes contact.law: one would override the other"),
    "same place": (("[0.0, 0.3, inf]", '["25 um", "0.025 mm"]'), "values: '0.025 mm' is given twice, also as '25 um'"),
    "same number": (("[0.0, 0.3, inf]", '["25 um", 2.5e-5]'), "values: '2.5e-05' is given twice, also as '25 um'"),
    "units": (("[0.0, 0.3, inf]", '["25 um", "30 deg"]'),
        "values: '25 um' is in m, '30 deg' is in rad; allowed: units of"),
    "large count": (("[0.0, 0.3, inf]", "{ from = 0, to = 1, count = 1000000000 }"), "a whole number from 2 to 100000"),
    "large product": (("[0.0, 0.3, inf]", "{ from = 0, to = 1, count = 50001 }"),
        "axes: 100002 points; allowed: at"),
    "large number": (("[0.0, 0.3, inf]", f"[1{'0' * 400}]"), "axes.contact.law.mu: "),
    "large end": (("[0.0, 0.3, inf]", f"{{ from = 0, to = 1{'0' * 400}, count = 3 }}"), "axes.contact.law.mu: "),
}  # fmt: skip


@pytest.mark.parametrize("kind", WRONG)
def test_invalid_studies(read, tmp_path, kind):
    (old, new), *texts = WRONG[kind]
    assert old in STUDY
    with pytest.raises(CaseError) as caught:
        read(STUDY.replace(old, new))
    assert str(tmp_path / "study.toml") in str(caught.value)
    for text in texts:
        assert text in str(caught.value)
    assert "not {'" not in str(caught.value), "the item is shown, not the whole study"


def test_nothing_to_run(read):
    with pytest.raises(CaseError, match=r"nothing to run; give \[axes\], \[\[points\]\] or both"):
        read('case = "case.toml"')


def test_documented_study(read):
    page = Path(__file__).parents[3] / "docs" / "howto" / "sweep.md"
    first, *_ = re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    study = read(first)
    assert len(list(study.changes())) == 5 * 2 * 2 + 1


def test_documented_selections(read, tmp_path, monkeypatch):
    """Quantities are the numbers of the points, over the axes of the page."""
    page = (Path(__file__).parents[3] / "docs" / "howto" / "sweep.md").read_text(encoding="utf-8")
    first, *_ = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (select,) = [code for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "open_dataset" in code]
    axes = read(re.sub(r"\[\[points\]\].*?\n\n", "", first, flags=re.DOTALL)).result_axes()
    numbers = np.arange(20.0).reshape([len(axis.labels) for axis in axes])
    names = ("normal_force", "max_pressure", "charge")
    texts = np.full(numbers.shape, "")
    made = SweepResult("", axes, dict.fromkeys(names, numbers), dict.fromkeys(names, ""), *[texts] * 3)
    (tmp_path / "out").mkdir()
    write_sweep(tmp_path / "out", made)
    monkeypatch.chdir(tmp_path)
    namespace: dict = {}
    exec(select, namespace)
    np.testing.assert_array_equal(namespace["deep"], numbers[:, 1])
    np.testing.assert_array_equal(namespace["frictional"], numbers[2])
    np.testing.assert_array_equal(namespace["insulating"], numbers[:, :, 0])


def test_named_axis(read):
    axis, changes = axis_of(read('case = "c.toml"\n[axes.mu]\n"contact.law.mu" = [0.1, 0.3]'))
    assert axis.name == "mu"
    np.testing.assert_array_equal(axis.values, [0.1, 0.3])
    assert changes == ({"contact.law.mu": 0.1}, {"contact.law.mu": 0.3})


@pytest.mark.parametrize(
    ("lines", "values"),
    [
        ('"contact.law.mu" = { from = 0, to = 0.4, count = 3 }', [0.0, 0.2, 0.4]),
        ('"contact.law.mu" = { from = 0, to = 0.4, count = 3 }\n"mesh.divisions" = [8, 16, 32]', [0.0, 0.2, 0.4]),
        ('"mesh.divisions" = [8, 16, 32]\n"contact.law.mu" = { from = 0, to = 0.4, count = 3 }', [8, 16, 32]),
    ],
)
def test_named_axis_of_spaced_values(read, lines, values):
    axis, changes = axis_of(read(f'case = "c.toml"\n[axes.mu]\n{lines}'))
    assert axis.name == "mu"
    np.testing.assert_allclose(axis.values, values)
    assert [change["contact.law.mu"] for change in changes] == [0.0, 0.2, 0.4]
    assert [change.get("mesh.divisions") for change in changes] in ([8, 16, 32], [None] * 3)
