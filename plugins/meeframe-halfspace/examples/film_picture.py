"""Draw a section through a film under a sphere in open circuit: `uv run python film_picture.py FILE.png`."""

import sys
from pathlib import Path

import numpy as np

import meeframe
from meeframe.results.figures import save_figure

CASE = Path(__file__).with_name("film.toml")

if __name__ == "__main__":
    case = meeframe.load_case(CASE)
    result = meeframe.solve_case(case)
    x, z = np.linspace(-1.5e-6, 1.5e-6, 61), np.linspace(-2e-6, -0.05e-6, 40)
    section = meeframe.PointGrid.along_global_axes(x, 0.0, z)
    fields = meeframe.interior(result, section, case=case, step="last")
    save_figure(fields.figure(case.title), Path(sys.argv[1]))
