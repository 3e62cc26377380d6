"""Pictures of the validation of section 7.1."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from study import Refinement, Sweep, closed_form

from meeframe.case.case import Case

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def sweep_picture(case: Case, sweeps: list[Sweep]) -> Figure:
    """Fig. 3: force relative to the insulated half space, charge or flux to the conducting one."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained", sharey=True)
    insulated = closed_form(case, "EMII").force
    for axis, found, name in zip(axes, sweeps, ("electric", "magnetic"), strict=True):
        flux = "charge" if name == "electric" else "magnetic_flux"
        force = [-s.totals.force[2] / insulated for s in found.solved]
        total = [getattr(s.totals, flux) / getattr(found.limit, flux) for s in found.solved]
        axis.semilogx(found.kappa, force, "o-", color=COLOURS[0], label="force P / P_EMII")
        axis.semilogx(
            found.kappa, total, "s-", color=COLOURS[1], label=f"{flux.replace('_', ' ')}, of the conducting one"
        )
        axis.axhline(found.limit.force / insulated, color=COLOURS[0], ls="--", lw=1)
        axis.axhline(1.0, color=COLOURS[1], ls="--", lw=1)
        axis.set(xlabel=f"{name} conductivity, times |ξ_cc| a", title=found.condition)
        axis.grid(alpha=0.3)
        axis.legend()
    return figure


def section_picture(case: Case, sections: list[Sweep]) -> Figure:
    """Fig. 4: pressure and potentials along x for several conductivities."""
    figure, axes = plt.subplots(3, 2, figsize=(10, 9), layout="constrained", sharex=True, sharey="row")
    insulated = closed_form(case, "EMII")
    a, origin = insulated.contact_radius, np.zeros(1)
    fields = ("pressure", "electric_potential", "magnetic_potential")
    scales = [float(getattr(insulated, name)(origin)[0]) for name in fields]
    fine = np.linspace(-2.5e-3, 2.5e-3, 401)
    for column, found in enumerate(sections):
        for row, (name, scale) in enumerate(zip(fields, scales, strict=True)):
            axis = axes[row, column]
            for exact, style in ((insulated, "-"), (found.limit, "--")):
                axis.plot(fine / a, getattr(exact, name)(np.abs(fine)) / scale, style, color="0.4", lw=1)
            for kappa, solved, colour in zip(found.kappa, found.solved, COLOURS, strict=False):
                x, pressure, potentials = solved.section()
                values = pressure if row == 0 else potentials[:, row - 1]
                axis.plot(x / a, values / scale, "o", ms=4, color=colour, label=f"{kappa:g}")
            axis.set_ylabel(f"{name.replace('_', ' ')} / insulated")
            axis.grid(alpha=0.3)
        axes[0, column].set_title(found.condition)
        axes[2, column].set_xlabel("x / a")
    axes[0, 0].legend(title="conductivity × |ξ_cc| a", fontsize=8)
    return figure


def convergence_picture(meshes: list[Refinement]) -> Figure:
    """Differences to the half space against the size of the block and of the elements."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained", sharey=True)
    largest = max(mesh.half_width for mesh in meshes)
    radius = np.sqrt(5e-5 * 0.1)
    studies = (
        (axes[0], [m for m in meshes if m.divisions == 16], lambda m: m.half_width / radius, "L / a, 16 x 16 elements"),
        (axes[1], [m for m in meshes if m.half_width == largest], lambda m: radius * m.divisions / 0.005, "a / h"),
    )
    curves = [("EMII", "force"), ("ECMII", "charge"), ("EIMCI", "magnetic_flux"), ("EMCI", "force")]
    for axis, chosen, abscissa, label in studies:
        chosen = sorted(chosen, key=abscissa)
        x = np.array([abscissa(m) for m in chosen])
        for (condition, key), colour in zip(curves, COLOURS, strict=False):
            y = [100 * abs(m.differences[condition][key]) for m in chosen]
            axis.loglog(x, y, "o-", color=colour, label=f"{condition}, {key.replace('_', ' ')}")
        axis.loglog(x, 2.0 * x[0] / x, ":", color="0.5", label="first order")
        axis.set_xlabel(label)
        axis.grid(alpha=0.3, which="both")
    axes[0].set_ylabel("difference to the half space [%]")
    axes[0].legend(fontsize=8)
    return figure
