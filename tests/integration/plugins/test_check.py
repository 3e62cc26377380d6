"""`meeframe plugins check` runs the conformance checks of everything that a file registers."""

import textwrap

import numpy as np
import pytest
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.fields.units import Quantity
from meeframe.plugin.aliases import ALIASES
from meeframe.plugin.registry import Registry, load
from meeframe.testing.plugin_files import _sample

LAW = """
from dataclasses import dataclass
import numpy as np
from meeframe.plugin import Indenter, OrthotropicCoulomb, Record, hookimpl

@dataclass(frozen=True)
class Tested(OrthotropicCoulomb):
    def tangential_scaling(self):
        return {scaling}

@hookimpl
def meeframe_contact_laws():
    return [Record("tested", Tested, "orthotropic friction", "none")]
"""


def invoke(*arguments):
    result = CliRunner().invoke(app, list(map(str, arguments)))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture
def write(tmp_path):
    def write(scaling):
        file = tmp_path / "tested.py"
        file.write_text(textwrap.dedent(LAW.format(scaling=scaling)), encoding="utf-8")
        return file

    return write


def test_correct_law_conforms(write):
    status, out, err = invoke(
        "plugins", "check", write("OrthotropicCoulomb.tangential_scaling(self)"), "--with",
        '{name = "tested", mu1 = 0.1, mu2 = 0.4}',
    )  # fmt: skip
    assert (status, err) == (0, "")
    assert "contact law tested (mu1 = 0.1, mu2 = 0.4): conforms" in out


def test_wrong_metric_is_named(write):
    status, out, _ = invoke("plugins", "check", write("np.eye(2)"), "--with", '{name = "tested", mu1 = 0.1, mu2 = 0.4}')
    assert status == 1
    assert "tested (mu1 = 0.1, mu2 = 0.4): fails: " in out
    assert "tangential_scaling" in out.partition("fails: ")[2].splitlines()[0]


def test_keys_without_default_get_a_sample_value(write):
    status, out, _ = invoke("plugins", "check", write("np.eye(2)"))
    assert "tested (mu1 = 0.3, mu2 = 0.3): conforms" in out  # isotropic, with the metric of isotropic friction
    assert status == 0
    status, out, _ = invoke("plugins", "check", write("np.eye(2)"), "--with", '{name = "tested", mu1 = -1}')
    assert status == 1
    assert "not checked: mu1" in out


@pytest.mark.parametrize("table", ['{name = "other", mu = 1}', "tested", "{mu1 = 1}"])
def test_tables_of_other_objects_are_rejected(write, table):
    status, out, err = invoke("plugins", "check", write("np.eye(2)"), "--with", table)
    assert (status, out) == (2, "")
    assert "needs an inline table whose name is one of tested" in err


@pytest.mark.parametrize(
    "quantity",
    [
        Quantity("Pa", gt=0),
        Quantity("", gt=0, lt=0.1),
        Quantity("", ge=1, lt=2),
        Quantity("m", gt=5.0),
        Quantity("m", lt=-2.0),
        Quantity("s"),
        Quantity("", gt=0, lt=float("inf")),
    ],
)
def test_sample_values_are_valid(quantity):
    assert np.isfinite(quantity.check(_sample(quantity)))


def test_misspelt_names_get_suggestions():
    status, _, err = invoke("plugins", "show", "jkr")
    assert status == 2
    assert "did you mean 'dugdale' or 'dmt'?" in err
    assert "did you mean 'dense-bem' or 'hmatrix-bem'?" in invoke("plugins", "show", "BEM")[2]
    assert "did you mean 'isotropic-coulomb' or 'orthotropic-coulomb'?" in invoke("plugins", "show", "coulom")[2]


def test_related_terms_suggest_registered_names():
    registry: Registry = load()
    names = {entry.record.name for entry in registry.entries}
    assert {name for computed in ALIASES.values() for name in computed} <= names
    assert not names & set(ALIASES)
