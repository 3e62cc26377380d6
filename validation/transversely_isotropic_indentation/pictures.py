"""Draw the figures of the page on section 7.1."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from study import Refinement, Sweep, closed_form, exact_totals

from meeframe.model.case import Case
from meeframe.results.canvas import label_panels

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
CURVES = [("EMII", "force"), ("ECMII", "charge"), ("EIMCI", "magnetic_flux"), ("EMCI", "force")]


def sweep_picture(case: Case, sweeps: list[Sweep]) -> Figure:
    """Draw Fig. 3: force relative to the insulated half space, charge or flux relative to the conducting one."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained", sharey=True)
    insulated = closed_form(case, "EMII").force
    for axis, result, name in zip(axes, sweeps, ("electric", "magnetic"), strict=True):
        flux = "charge" if name == "electric" else "magnetic_flux"
        force = [-s.totals.force[2] / insulated for s in result.solved]
        total = [getattr(s.totals, flux) / getattr(result.limit, flux) for s in result.solved]
        axis.semilogx(result.kappa, force, "o-", color=COLOURS[0], label="force P / P_EMII")
        axis.semilogx(
            result.kappa, total, "s-", color=COLOURS[1], label=f"{flux.replace('_', ' ')}, of the conducting one"
        )
        axis.axhline(result.limit.force / insulated, color=COLOURS[0], ls="--", lw=1)
        axis.axhline(1.0, color=COLOURS[1], ls="--", lw=1)
        axis.set(xlabel=f"{name} conductivity, times |ξ_cc| a", title=result.condition)
        axis.grid(visible=True)
        axis.legend()
    label_panels(axes)
    return figure


def section_picture(case: Case, sections: list[Sweep]) -> Figure:
    """Draw Fig. 4: pressure and potentials along x for several conductivities."""
    figure, axes = plt.subplots(3, 2, figsize=(10, 9), layout="constrained", sharex=True, sharey="row")
    insulated = closed_form(case, "EMII")
    a, origin = insulated.contact_radius, np.zeros(1)
    fields = ("pressure", "electric_potential", "magnetic_potential")
    scales = [float(getattr(insulated, name)(origin)[0]) for name in fields]
    fine = np.linspace(-2.5e-3, 2.5e-3, 401)
    for column, result in enumerate(sections):
        for row, (name, scale) in enumerate(zip(fields, scales, strict=True)):
            axis = axes[row, column]
            for exact, style in ((insulated, "-"), (result.limit, "--")):
                axis.plot(fine / a, getattr(exact, name)(np.abs(fine)) / scale, style, color="0.4", lw=1)
            for kappa, solved, colour in zip(result.kappa, result.solved, COLOURS, strict=False):
                x, pressure, potentials = solved.section()
                values = pressure if row == 0 else potentials[:, row - 1]
                axis.plot(x / a, values / scale, "o", ms=4, color=colour, label=f"{kappa:g}")
            axis.set_ylabel(f"{name.replace('_', ' ')} / insulated")
            axis.grid(visible=True)
        axes[0, column].set_title(result.condition)
        axes[2, column].set_xlabel("x / a")
    axes[0, 0].legend(title="conductivity × |ξ_cc| a", fontsize=8)
    label_panels(axes.ravel())
    return figure


def convergence_picture(case: Case, meshes: list[Refinement]) -> Figure:
    """Draw the convergence of block to half space and of half space to closed form."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    radius = closed_form(case, "EMII").contact_radius
    halves = [mesh for mesh in meshes if np.isinf(mesh.enlargement)]
    blocks = [mesh for mesh in meshes if not np.isinf(mesh.enlargement)]
    same = next(mesh for mesh in halves if mesh.divisions == blocks[0].divisions)
    studies = (
        (axes[0], [m.half_width / radius for m in blocks], [(m.totals, same.totals) for m in blocks]),
        (axes[1], [radius * m.divisions / 0.005 for m in halves], [(m.totals, None) for m in halves]),
    )
    for axis, x, pairs in studies:
        for (condition, key), colour in zip(CURVES, COLOURS, strict=False):
            exact = exact_totals(closed_form(case, condition))
            true = [exact if reference is None else reference[condition] for _, reference in pairs]
            y = [100 * abs(result[condition][key] / t[key] - 1) for (result, _), t in zip(pairs, true, strict=True)]
            axis.loglog(x, y, "o-", color=colour, label=f"{condition}, {key.replace('_', ' ')}")
        start = max(line.get_ydata()[0] for line in axis.lines)
        axis.loglog(x, [1.5 * start * x[0] / v for v in x], ":", color="0.5", label="first order")
        axis.grid(visible=True)
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter(NullFormatter())
    axes[0].set(xlabel="L / a", ylabel="difference [%]", title="block to half space, 16 x 16 elements")
    axes[1].set(xlabel="a / h", title="half space to closed form")
    axes[0].legend(fontsize=8)
    label_panels(axes)
    return figure
