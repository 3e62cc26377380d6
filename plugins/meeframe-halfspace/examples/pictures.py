"""Draw the picture of docs/explanation/halfspace.md, of rough.toml: python pictures.py OUT.png."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from meeframe.model.load import load_case
from meeframe.model.solve import solve_case
from meeframe.results.canvas import label_panels

FIELDS = (
    ("contact pressure [MPa]", "cividis", lambda step: -step.traction[:, 2] / 1e6),
    ("fraction of the friction limit", "cividis", lambda step: _mobilization(step.traction, 0.3)),
    ("electric potential [V]", "RdBu_r", lambda step: step.potentials[:, 0]),
)


def _mobilization(traction: np.ndarray, mu: float) -> np.ndarray:
    limit = -mu * traction[:, 2]
    return np.divide(np.hypot(*traction[:, :2].T), limit, where=limit > 0.0, out=np.full(len(limit), np.nan))


def main(out: Path) -> None:
    """Solve and draw the last step."""
    result = solve_case(load_case(Path(__file__).with_name("rough.toml")))
    step, points = result.steps[-1], 1e3 * result.zone.points
    print([(s.status.value, s.iterations) for s in result.steps], (step.traction[:, 2] < 0).mean())
    count = round(len(points) ** 0.5)
    order = np.lexsort((points[:, 0], points[:, 1]))
    figure, axes = plt.subplots(1, 3, figsize=(13, 3.6), layout="constrained", sharey=True)
    for axis, (label, colours, values) in zip(axes, FIELDS, strict=True):
        grid = values(step)[order].reshape(count, count)
        grid = np.where(grid == 0.0, np.nan, grid) if "pressure" in label else grid
        span = np.nanmax(np.abs(grid))
        limits = {"vmin": -span, "vmax": span} if "potential" in label else {"vmin": 0.0}
        edge = [points[:, 0].min(), points[:, 0].max(), points[:, 1].min(), points[:, 1].max()]
        image = axis.imshow(grid, origin="lower", extent=edge, cmap=colours, interpolation="nearest", **limits)
        figure.colorbar(image, ax=axis, label=label)
        axis.set(xlabel="x [mm]")
        axis.spines[:].set_visible(True)
        axis.locator_params(nbins=5)
    axes[0].set_ylabel("y [mm]")
    label_panels(axes)
    figure.savefig(out, dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
