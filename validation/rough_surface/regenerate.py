"""Regenerate the page on densities of loads under rough surfaces.

    uv run python validation/rough_surface/regenerate.py

Writes docs/validation/rough_density.md with its figure, and the numbers as JSON. `--out` names another folder,
`--finest` another number of nodes along a side.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, get_args

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

import matplotlib

matplotlib.use("Agg")  # no window

import matplotlib.pyplot as plt
import numpy as np
from checks import PERIOD, PRESSURES, SLOPE, Density, heights_of, ours, reduced, surface
from isotropic import MODULUS

from meeframe.results.canvas import label_panels

NAME: Final = "rough_density"
DOCS: Final = Path(__file__).parents[2] / "docs" / "validation"
WAVES: Final = 8
"""Number of shortest waves along the period."""
QUANTITIES: Final = {"area": "contact area", "gap": "mean gap", "pressure": "largest pressure"}
COLOURS: Final = {"bilinear": "#0072B2", "constant": "#D55E00", "trigonometric": "#009E73"}


HEAD: Final = f"""# Densities of loads under rough surfaces

The [half space](../explanation/halfspace.md) spreads the load of a node over its neighbourhood in one of three ways.
This page compares them on one periodic self-affine surface (Hurst exponent 0.8, roll-off at half the period, shortest
wave an eighth of it), which is rigid and presses on an isotropic half space without friction. All grids sample the
same sum of waves. To regenerate the page, run `uv run python validation/rough_surface/regenerate.py`.

![Errors of the contact area, mean gap and largest pressure for three densities]({NAME}.png)

- **Contact area.** `bilinear` approaches it from below, `constant` and `trigonometric` from above. Neither of the
  first two is always closer; `trigonometric`, the waves of other codes, has the largest error. Areas counted by nodes
  differ by several per cent with eight samples in the shortest wave. The mean of `bilinear` and `constant` is then
  accurate to one per cent.
- **Mean gap and largest pressure.** The gap of `constant` is about twice as accurate as that of `bilinear`, that of
  `trigonometric` more accurate still. The largest pressure is off by up to 23 % (`bilinear`) or 10 % (`constant`) with
  four samples in the shortest wave, and by less than 0.6 % with 16 or more, whatever the density.
- **Default.** It is `bilinear`: its area is as accurate as that of `constant`, and it is better where tractions or
  charges are singular at contact edges. Solve with both to bracket the area.
"""


@dataclass(frozen=True)
class Row:
    """A solution: samples in the shortest wave, fraction of the area, mean gap [m], largest pressure [Pa]."""

    load: float
    density: Density
    samples: int
    area: float
    gap: float
    pressure: float


def main() -> None:
    """Run the study and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (default: docs/validation)")
    parser.add_argument("--finest", type=int, default=512, help="nodes along a side of the finest grid (default: 512)")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    counts = [32 * 2**k for k in range(10) if 32 * 2**k <= arguments.finest]
    rows = list(solutions(counts))
    limits = {load: {name: limit(rows, load, name) for name in QUANTITIES} for load in PRESSURES}
    picture(rows, limits).savefig(arguments.out / f"{NAME}.png", dpi=150)
    (arguments.out / f"{NAME}.md").write_text("\n".join(page(rows, limits)) + "\n", encoding="utf-8")
    numbers = {"rows": [asdict(row) for row in rows], "limits": {str(load): value for load, value in limits.items()}}
    (arguments.out / f"{NAME}.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


def solutions(counts: list[int]) -> Iterator[Row]:
    """Solve the same surface at two mean pressures on all grids with all densities."""
    for load in PRESSURES:
        for count in counts:
            heights = heights_of(surface(count, PERIOD / WAVES))
            for density in get_args(Density):
                contact = ours(reduced(count, density), heights, load * MODULUS * SLOPE)
                gap, pressure = float(contact.gap.mean()), float(contact.pressure.max())
                yield Row(load, density, count // WAVES, contact.area, gap, pressure)


def limit(rows: list[Row], load: float, name: str) -> tuple[float, float]:
    """Return the limit of a quantity and the spread of the three extrapolations, linear in the spacing, of which it is
    the mean.
    """
    values = []
    for density in get_args(Density):
        coarse, fine = [getattr(row, name) for row in rows if (row.load, row.density) == (load, density)][-2:]
        values.append(2.0 * fine - coarse)
    return float(np.mean(values)), float(np.ptp(values))


def picture(rows: list[Row], limits: dict[float, dict[str, tuple[float, float]]]) -> plt.Figure:
    """Draw relative errors over the number of samples in the shortest wave."""
    figure, axes = plt.subplots(1, len(QUANTITIES), figsize=(11, 3.6), layout="constrained")
    for ax, (name, label) in zip(axes, QUANTITIES.items(), strict=True):
        for density, colour in COLOURS.items():
            for load, style in zip(PRESSURES, ("o--", "s-"), strict=True):
                chosen = [row for row in rows if (row.load, row.density) == (load, density)]
                errors = [100.0 * (getattr(row, name) / limits[load][name][0] - 1.0) for row in chosen]
                ax.plot(
                    [row.samples for row in chosen], errors, style, color=colour, ms=4, label=f"{density}, {load:g}"
                )
        ax.axhline(0.0, color="0.6", lw=0.8)
        ax.set(xscale="log", xlabel="samples in the shortest wave", ylabel=f"error of the {label} [%]")
        ax.set_xticks([row.samples for row in chosen], [str(row.samples) for row in chosen])
        ax.minorticks_off()
        ax.grid(visible=True)
    axes[-1].set_ylim(-5, 15)
    axes[0].legend(title="density, mean pressure / E* h'", fontsize=7, title_fontsize=7)
    label_panels(axes)
    return figure


def page(rows: list[Row], limits: dict[float, dict[str, tuple[float, float]]]) -> Iterator[str]:
    """Yield the lines of the page."""
    yield HEAD
    labels = [f"{QUANTITIES[name]}, {density}" for name in QUANTITIES for density in COLOURS]
    columns = [(name, density) for name in QUANTITIES for density in COLOURS]
    for load in PRESSURES:
        yield from ("", f"## Mean pressure {load:g} E* h'", "", "Relative errors in per cent:", "")
        yield f"| samples in the shortest wave | {' | '.join(labels)} |"
        yield "|" + " --- |" * (1 + len(columns))
        for samples in dict.fromkeys(row.samples for row in rows):
            cells = []
            for name, density in columns:
                (row,) = [r for r in rows if (r.load, r.samples, r.density) == (load, samples, density)]
                cells.append(f"{100.0 * (getattr(row, name) / limits[load][name][0] - 1.0):+.2f}")
            yield f"| {samples} | {' | '.join(cells)} |"
        area, gap, pressure = (limits[load][name] for name in QUANTITIES)
        yield from (
            "",
            f"Limits: {100 * area[0]:.3f} % of the area (± {_half(area)} %), mean gap {1e6 * gap[0]:.4f} µm "
            f"(± {_half(gap)} %), largest",
            f"pressure {pressure[0] / 1e9:.3f} GPa (± {_half(pressure)} %). Each is the mean of three extrapolations, "
            "linear in the spacing,",
            "from the two finest grids; ± is half their spread.",
        )


def _half(value: tuple[float, float]) -> str:
    return f"{50.0 * value[1] / value[0]:.2f}"


if __name__ == "__main__":
    main()
