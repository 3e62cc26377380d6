"""Commands load modules only when needed, and kernels are compiled once for all processes."""

import gc
import importlib
import os
import subprocess
import sys

import pytest

from meeframe.cli import console

HEAVY = (
    "numpy", "scipy", "numba", "matplotlib", "h5py", "pydantic", "pint", "meshio", "pluggy", "pandas", "xarray", "dask",
    "distributed",
)  # fmt: skip
LATER = (
    "matplotlib", "meshio", "pandas", "xarray", "distributed", "pint", "dask", "skfem", "scipy.optimize",
    "scipy.interpolate", "scipy.ndimage", "scipy.spatial", "scipy.special", "scipy.fft",
)  # fmt: skip
LISTING = """
import sys
from meeframe.cli import main
sys.argv = ["meeframe", *sys.argv[1:]]
try:
    main()
except SystemExit as done:
    assert not done.code, done.code
print("loaded:", *{".".join(name.split(".")[:parts]) for name in sys.modules for parts in (1, 2)})
"""


def python(*arguments, **variables):
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, env=os.environ | variables)
    assert done.returncode == 0, done.stderr
    return done.stdout


def loaded_modules(*arguments):
    return set(python("-c", LISTING, *arguments).splitlines()[-1].split()[1:])


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_loads_nothing_heavy(option):
    assert loaded_modules(option).isdisjoint(HEAVY)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("command", ["run", "sweep"])
def test_help_of_a_command_loads_nothing_heavy(command):
    """Only pydantic is loaded, because typer uses it to read arguments."""
    assert loaded_modules(command, "--help").isdisjoint({*HEAVY} - {"pydantic"})


@pytest.mark.full
def test_check_loads_only_what_it_needs(case_file):
    computed = loaded_modules("check", case_file)
    assert "numba" in computed
    assert computed.isdisjoint(LATER)


@pytest.mark.full
def test_run_without_figures_does_not_load_plotting(case_file, tmp_path):
    case_file.write_text(case_file.read_text() + "\n[output]\nfigures = false\nvtu = false\n")
    assert loaded_modules("run", case_file, "--out", tmp_path / "out").isdisjoint(LATER)


def test_garbage_collection_resumes_after_import():
    with console.loading():
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(ImportError), console.loading():
        importlib.import_module("meeframe.no_such_module")
    assert gc.isenabled()
    gc.disable()
    try:
        with console.loading():
            pass
        assert not gc.isenabled(), "as the caller had it"
    finally:
        gc.enable()
        gc.unfreeze()


@pytest.mark.full
def test_second_process_compiles_nothing(case_file, tmp_path):
    """numba reports which functions it loads from its cache and which it saves."""
    run = "-m", "meeframe", "run", case_file, "--overwrite", "--out", tmp_path / "out"
    python(*run)
    output = python(*run, NUMBA_DEBUG_CACHE="1")
    assert output.count("[cache] data loaded") > 3
    assert output.count("[cache] data saved") == 0
