"""Statements of the reference paper about its figures 3 to 14, compared with the reproduced figures."""

from collections.abc import Callable, Iterator

import numpy as np
from criteria import CLEARLY, UNALTERED, Claim, Observed, change, claim, percent, size
from figures import Figure, Panel
from tangential import directions, fig_10, maps_under_load

ANALYTIC = 0.015
"""Largest difference between the paper's finite block and the half space (docs/explanation/theory.md, Half space)."""
HALF_SPACE_RISES = {1e-12: 1.02, 1e-9: 0.92, 5e-9: 0.71, 8e-9: 0.63, 1e-8: 0.59}
"""Rise of the largest electric potential at mu = 0.9, computed by an independent half-space solver
(docs/explanation/theory.md,
Half space), by scale of the magneto-electric coefficients [s/m]."""
BLOCK = 0.05
"""Largest difference of this rise on the paper's finite block and mesh."""


def claims(figure: Figure) -> list[Claim]:
    """Return the claims about a figure; an empty list if there are none."""
    evaluate = EVALUATIONS.get(figure.name)
    return [] if evaluate is None else [claim(figure.name, *result) for result in evaluate(figure)]


def _fig_03(figure: Figure) -> Observed:
    for panel, flux in zip(figure.panels, ("charge", "magnetic_flux"), strict=True):
        total = panel.quantities[flux][-1]
        limit = {"charge": 21896.1, "magnetic_flux": 23287.8}[flux] / 23330.6  # docs/explanation/theory.md
        force = panel.quantities["force"][-1] / limit
        yield (
            f"{panel.title}: force and {flux.replace('_', ' ')} converge to the analytic values",
            f"force {percent(force - 1)}, {flux.replace('_', ' ')} {percent(total - 1)} relative to them",
            f"differences below {size(ANALYTIC)}",
            max(abs(force - 1), abs(total - 1)) < ANALYTIC,
        )


def _fig_04(figure: Figure) -> Observed:
    for panel, field, other in _conducting(figure):
        contact_fraction = panel.of("pressure", "inf") > 0
        left = np.abs(panel.of(field, "inf")[contact_fraction]).max()
        altered = change(panel, other, "inf", "0")
        yield (
            f"{panel.title}: the {field.replace('_', ' ')} tends to zero",
            f"{left:.1e} of the insulated value remains in the contact",
            "less than 1e-6",
            bool(left < 1e-6),
        )
        yield (
            f"{panel.title}: the {other.replace('_', ' ')} remains unaltered",
            f"changes by {size(altered)}",
            f"less than {size(UNALTERED)}",
            altered < UNALTERED,
        )


def _conducting(figure: Figure) -> Iterator[tuple[Panel, str, str]]:
    """Yield the panels of ECMII and EIMCI with the conducting field and the other one."""
    fields = ("electric_potential", "magnetic_potential")
    yield figure.panel("ECMII"), *fields
    yield figure.panel("EIMCI"), *fields[::-1]


def _fig_05(figure: Figure) -> Observed:
    force = figure.panel("(a)").quantities["force"]
    yield (
        "ECMII: the conductivity only affects the electric variables",
        f"the force changes by {percent(force[-1] - 1)}",
        f"less than {size(UNALTERED)}",
        bool(np.abs(force - 1).max() < UNALTERED),
    )
    force = figure.panel("(b)").quantities["force"]
    yield (
        "EIMCI: the force is reduced by half as the magnetic conductivity grows",
        f"decreases monotonically to {force[-1]:.3f} of the insulated value (half space: 0.43)",
        "monotonic, to between 0.4 and 0.5",
        bool(np.all(np.diff(force) < 0) and 0.4 < force[-1] < 0.5),
    )


def _fig_05_sizes(figure: Figure) -> Observed:
    for panel in figure.panels:
        (force,) = panel.quantities.values()
        yield (
            f"{panel.title}: the force is reduced by half",
            f"decreases to {force[-1]:.3f} of the insulated value (independent half space: 0.43)",
            "between 0.4 and 0.5",
            0.4 < force[-1] < 0.5,
        )


def _fig_06(figure: Figure) -> Observed:
    panel = figure.panel("ECMII")
    changes = {name: change(panel, name, "inf", "0") for name in ("pressure", "magnetic_potential")}
    yield (
        "ECMII: only the electric potential changes",
        ", ".join(f"{name.replace('_', ' ')} {size(value)}" for name, value in changes.items()),
        f"others less than {size(UNALTERED)}",
        max(changes.values()) < UNALTERED,
    )
    panel = figure.panel("EIMCI")
    changes = {name: change(panel, name, "inf", "0") for name in panel.quantities}
    electric = changes["electric_potential"]
    yield (
        "EIMCI: all variables are clearly modified",
        ", ".join(f"{name.replace('_', ' ')} {size(value)}" for name, value in changes.items()),
        f"each more than {size(CLEARLY)}",
        min(changes.values()) > CLEARLY,
        "the electric potential hardly depends on the magnetic conductivity",
        electric < UNALTERED and all(value > CLEARLY for value in changes.values() if value != electric),
    )


def _fig_07(figure: Figure) -> Observed:
    panel = figure.panel("(a)")
    rising = all(np.all(np.diff(values) > 0) for values in panel.quantities.values())
    ends = ", ".join(f"{name.replace('_', ' ')} {percent(v[-1] - 1)}" for name, v in panel.quantities.items())
    yield "EMII: force and largest potentials increase with friction", f"at 0.9: {ends}", "each monotonic", rising
    for name, said, within in (("electric", 0.65, 0.10), ("magnetic", 0.30, 0.05)):
        rise = panel.quantities[f"max_{name}_potential"][-1] - 1
        yield (
            f"EMII: the largest {name} potential rises by {percent(said)} at 0.9",
            percent(rise),
            f"within {100 * within:g} percentage points",
            abs(rise - said) < within,
        )
    changes = {name: values[-1] - 1 for name, values in figure.panel("(b)").quantities.items()}
    yield (
        "EMCI: force, charge and magnetic flux are not significantly affected",
        ", ".join(f"{name.replace('_', ' ')} {percent(value)}" for name, value in changes.items()),
        f"each less than {size(CLEARLY)}, the force less than {size(UNALTERED)}",
        max(map(abs, changes.values())) < CLEARLY and abs(changes["force"]) < UNALTERED,
    )


def _fig_07_scales(figure: Figure) -> Observed:
    for panel in figure.panels:
        scale = float(panel.title.split()[0])
        electric, magnetic = (panel.quantities[f"max_{name}_potential"][-1] - 1 for name in ("electric", "magnetic"))
        half_space = HALF_SPACE_RISES[scale]
        yield (
            f"coefficients in {panel.title}: +65 % electric, +30 % magnetic",
            f"electric {percent(electric)} (independent half space {percent(half_space)}), "
            f"magnetic {percent(magnetic)}",
            "electric within 10 percentage points, magnetic within 5",
            abs(electric - 0.65) < 0.10 and abs(magnetic - 0.30) < 0.05,
            "the paper's 65 % corresponds to a scale of 5e-9 to 8e-9 s/m",
            scale < 5e-9 and abs(electric - half_space) < BLOCK and abs(magnetic - 0.30) < 0.05,
        )


def _fig_08(figure: Figure) -> Observed:
    (panel,) = figure.panels
    tops = panel.quantities["traction_x"].max(axis=1)
    yield (
        "friction causes tangential tractions, which raise the stresses in the body",
        "largest traction along x " + ", ".join(f"{top:.2f}" for top in tops) + " of the frictionless pressure",
        "rises with the friction coefficient",
        bool(np.all(np.diff(tops) > 0)),
    )


def _fig_09(figure: Figure) -> Observed:
    (panel,) = figure.panels
    for name in panel.quantities:
        tops = {run: float(panel.of(name, run).max()) for run in panel.runs}
        shapes = {run: panel.elongation(name, run) for run in panel.runs}
        yield (
            f"the orthotropic law changes values and shape of the {name.replace('_', ' ')}",
            "; ".join(f"{run}: largest {tops[run]:.2f}, width x / width y {shapes[run]:.3f}" for run in panel.runs),
            "largest values differ by more than 5 %, shapes by more than 2 %",
            all(
                abs(tops[run] - tops["μ₁ = μ₂ = 0.6"]) > 0.05 and abs(shapes[run] / shapes["frictionless"] - 1) > 0.02
                for run in panel.runs[2:]
            ),
        )


EVALUATIONS: dict[str, Callable[[Figure], Observed]] = {
    "fig-03": _fig_03,
    "fig-04": _fig_04,
    "fig-05": _fig_05,
    "fig-05-sizes": _fig_05_sizes,
    "fig-06": _fig_06,
    "fig-07": _fig_07,
    "fig-07-scales": _fig_07_scales,
    "fig-08": _fig_08,
    "fig-09": _fig_09,
    "fig-10": fig_10,
    "fig-11": maps_under_load,
    "fig-12": maps_under_load,
    "fig-13": directions,
    "fig-14": directions,
}
