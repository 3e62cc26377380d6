"""The script of docs/howto/cluster.md runs, with jobs of this machine in place of those of a batch system."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import xarray

import meeframe

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "cluster.md"
# instead of the batch system
HERE = {"dask_jobqueue ": "dask_jobqueue.local ", "SLURM": "Local", "jobs=10": "jobs=2", "cores=8": "cores=1"}


def test_script(write_case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_case(('name = "winkler"\nstiffness = "1e14 Pa/m"', 'name = "dense-bem"')).rename("emii.toml")
    script = re.search(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.M)[1]
    for text, replacement in HERE.items():
        assert text in script
        script = script.replace(text, replacement)
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, timeout=500)
    dataset = xarray.load_dataset("out/friction/sweep.h5", engine="h5netcdf")
    assert (dataset.status == "converged").all()
    (system,) = Path("systems").glob("*.h5")
    assert not list(Path("out/friction/systems").iterdir())

    # one process finds the reduced system and agrees
    written = system.stat().st_mtime_ns
    case = meeframe.Case.from_toml("emii.toml")
    axes = {"contact.law": [{"name": "isotropic-coulomb", "mu": 0.1}]}
    alone = meeframe.sweep(case, axes | {"steps[1].approach": ["20 um"]}, "out/alone", systems="systems")
    assert system.stat().st_mtime_ns == written
    np.testing.assert_allclose(alone.normal_force, dataset.normal_force[:1, 1:2], rtol=1e-12)
