"""The paraboloid of the elliptic contact can be given as heights."""

from pathlib import Path

import numpy as np
import pytest

import meeframe

CASE = Path(__file__).parents[3] / "validation" / "elliptic_hertz" / "paraboloid.toml"
RADII = 'name = "paraboloid"\nradius_x = "200 mm"\nradius_y = "20 mm"'
HEIGHTS = 'name = "heights"\nfile = "paraboloid.csv"\ninterpolation = "cubic"'


def test_cubic_heights_match_the_paraboloid(tmp_path: Path) -> None:
    """Cubic interpolation of 5 x 5 heights represents the paraboloid exactly."""
    text = CASE.read_text(encoding="utf-8").replace("divisions = 76", "divisions = 20")
    assert RADII in text
    x, y = np.meshgrid(np.linspace(-5e-3, 5e-3, 5), np.linspace(-1.2e-3, 1.2e-3, 5), indexing="ij")
    rows = np.column_stack([x.ravel(), y.ravel(), (x**2 / 0.4 + y**2 / 0.04).ravel()])
    np.savetxt(tmp_path / "paraboloid.csv", rows, delimiter=", ")
    results = []
    for name, table in (("radii", RADII), ("heights", HEIGHTS)):
        path = tmp_path / f"{name}.toml"
        path.write_text(text.replace(RADII, table), encoding="utf-8")
        results.append(meeframe.solve_case(meeframe.load_case(path)))
    own, given = (result.steps[-1] for result in results)
    assert own.touching.any()
    assert not own.touching.all()
    np.testing.assert_array_equal(given.touching, own.touching)
    np.testing.assert_allclose(given.traction, own.traction, rtol=0.0, atol=1e-6 * np.abs(own.traction).max())
    assert given.initial_gap == pytest.approx(own.initial_gap, abs=1e-15)
