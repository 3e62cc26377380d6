"""Test `meeframe materials` and `meeframe materials show`."""

from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.material import library


def invoke(*arguments):
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.stdout, result.stderr


def test_list_names_every_material():
    status, out, err = invoke("materials")
    assert (status, err) == (0, "")
    rows = {line.split()[0]: line for line in out.splitlines() if line.strip()}
    for entry in library():
        assert entry.symmetry in rows[entry.name]
        assert entry.confidence in rows[entry.name]
    assert "piezomagnetic" in rows["cofe2o4"]
    assert "elastic" in rows["steel"]


def test_page_of_each_material():
    for entry in library():
        status, out, _ = invoke("materials", "show", entry.name)
        assert status == 0
        assert entry.source in out
        assert entry.note in out
    status, out, _ = invoke("materials", "show", "pzt-5h")
    assert ["e_333", "C/m^2", "23.3"] in [line.split() for line in out.splitlines()]
    assert "young_modulus [Pa] (required)" in invoke("materials", "show", "isotropic")[1]


def test_unknown_material_suggests_similar_names():
    status, out, err = invoke("materials", "show", "pzt5h")
    assert (status, out) == (2, "")
    assert "did you mean 'pzt-5h'?" in err
