"""The memory that is announced for a grid is that of a run with contact on a quarter of it, within 20 %."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from meeframe.model.load import load_case
from meeframe.model.memory import required_memory

CASE = """
[material]
name = "batio3-cofe2o4"
[mesh]
type = "half-space"
contact_width = "2.2 mm"
divisions = 511
[formulation]
name = "half-space"
[indenter]
name = "sphere"
radius = "0.1 m"
{laws}
[[steps]]
normal_force = 500.0
{load}"""
SILENT = "[output]\nfigures = false\nvtu = false\n"
FRICTION = '[contact.law]\nname = "isotropic-coulomb"\nmu = 0.3\n'
PARTIAL_SLIP = "tangential_force = [75.0, 0.0]\n"


# the command, then the peak of the new process
RUN = """
from meeframe.cli import main
from meeframe.model.clock import peak_memory_mb
try:
    main()
finally:
    print(peak_memory_mb())
"""


@pytest.mark.parametrize(
    ("laws", "load", "output"),
    [("", "", SILENT), (FRICTION, PARTIAL_SLIP, SILENT), (FRICTION, PARTIAL_SLIP, "")],
    ids=["normal", "friction", "friction with reports"],
)
def test_announced_memory(laws: str, load: str, output: str, tmp_path: Path) -> None:
    file = tmp_path / "case.toml"
    file.write_text(CASE.format(laws=laws, load=load) + output, encoding="utf-8")
    case = load_case(file)
    words = "run", str(file), "--out", str(tmp_path / "out"), "--threads", "1"
    # arrays are returned when they are freed, as the larger ones of large grids are anyway
    environment = os.environ | {"MALLOC_MMAP_THRESHOLD_": "1000000"}
    out = subprocess.run(
        (sys.executable, "-c", RUN, *words), env=environment, capture_output=True, text=True, check=True
    )
    peak = 1e6 * float(out.stdout.splitlines()[-1])
    required = required_memory(512 * 512, case.contact_law, case.channels, case.output.has_reports)
    assert required == pytest.approx(peak, rel=0.2)
