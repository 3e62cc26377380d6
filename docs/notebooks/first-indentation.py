# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # First indentation and its validation
#
# A steel sphere presses on a steel half space, then a conducting sphere on a piezoelectric one. Both problems have closed
# forms. You learn how to
#
# - describe a case in Python and solve it,
# - read force, contact area, pressure and charge from the result,
# - compare them with Hertz's theory and with the closed form for piezoelectric half spaces,
# - measure the order of convergence, so that you know the error on your grid.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import meeframe

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## A case
#
# The half space needs a grid only where contact may occur. Quantities are SI numbers or texts with units. The case is
# checked when it is created, so a wrong unit or an unknown key is an error here and not after a long run.

# %%
STEEL = {"name": "isotropic", "young_modulus": "210 GPa", "poisson_ratio": 0.3}


def steel_sphere(divisions):
    return meeframe.Case(
        title="Rigid sphere on steel",
        material=STEEL,
        mesh=meeframe.mesh.half_space("1.4 mm", divisions=divisions),
        formulation=meeframe.formulation("half-space"),
        indenter=meeframe.Sphere("100 mm"),
        steps=[meeframe.Step(approach="3 um", increments=6)],
    )


result = steel_sphere(40).solve()
result

# %% [markdown]
# `to_dataframe` has one row for each increment, in SI units.

# %%
curve = result.to_dataframe()
curve[
    [
        "approach",
        "normal_force",
        "contact_area",
        "max_pressure",
        "iterations",
        "status",
    ]
]

# %% [markdown]
# ## Hertz
#
# For a sphere of radius $R$, Hertz found the contact radius $a = \sqrt{R g}$ and the force $P = 4 E^* a^3/(3 R)$ at the
# approach $g$, with $E^* = E/(1-\nu^2)$ because the sphere is rigid. `meeframe.testing` has this and many other closed forms.

# %%
from meeframe.testing.closed_forms_friction import HertzContact

hertz = [HertzContact(210e9, 0.3, 0.1, approach) for approach in curve["approach"]]
curve["force_error"] = curve["normal_force"] / [h.force for h in hertz] - 1
curve["pressure_error"] = (
    curve["max_pressure"] / [h.peak_pressure for h in hertz] - 1
)

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
approach = np.linspace(0, 3e-6, 100)
exact = [HertzContact(210e9, 0.3, 0.1, g).force if g else 0.0 for g in approach]
left.plot(1e6 * approach, exact, label="Hertz")
left.plot(1e6 * curve["approach"], curve["normal_force"], "o", label="meeframe")
left.set(xlabel="approach [µm]", ylabel="normal force [N]")
left.legend()

section = (
    result.to_xarray()["pressure"].isel(increment=-1).sel(y=0, method="nearest")
)
x = np.linspace(-0.7e-3, 0.7e-3, 400)
right.plot(1e3 * x, 1e-6 * hertz[-1].pressure(abs(x)), label="Hertz")
right.plot(1e3 * section.x, 1e-6 * section, "o", ms=3, label="meeframe")
right.set(xlabel="x [mm]", ylabel="pressure [MPa]")
right.legend()

# %%
worst = curve[["force_error", "pressure_error"]].abs().max()
print(
    "largest deviation from Hertz: "
    f"force {worst.force_error:.2%}, pressure {worst.pressure_error:.2%}"
)
assert worst.force_error < 0.01
assert curve["force_error"].abs().idxmax() == 0  # the first increment

# %% [markdown]
# The error is largest in the first increment, where the contact is only a few nodes wide. The contact itself is a disc,
# as far as the grid can tell:

# %%
result.plot.pressure()

# %% [markdown]
# ## Order of convergence
#
# A single agreement may be luck. Halve the spacing and see whether the error falls as the theory predicts: by a factor of four,
# because the force of the half space is of second order.

# %%
rows = []
for divisions in (10, 20, 40, 80):
    last = steel_sphere(divisions).solve(progress=False).to_dataframe().iloc[-1]
    rows.append((divisions, abs(last["normal_force"] / hertz[-1].force - 1)))
grids = pd.DataFrame(rows, columns=["divisions", "error of the force"])

order = -np.polyfit(
    np.log(grids["divisions"]), np.log(grids["error of the force"]), 1
)[0]
print(f"observed order of convergence: {order:.1f}")
assert order > 1.5

axes = plt.subplots(figsize=(5, 3.6), layout="constrained")[1]
axes.loglog(grids["divisions"], grids["error of the force"], "o-", label="meeframe")
axes.loglog(
    grids["divisions"], 0.3 * grids["divisions"] ** -2.0, "--", label="second order"
)
axes.set(
    xlabel="divisions of the contact zone [1]",
    ylabel="relative error of the force [1]",
)
axes.set_xticks(grids["divisions"], grids["divisions"])
axes.minorticks_off()
axes.legend()

# %% [markdown]
# On each grid, the contact edge lies at a different place between the nodes, which scatters the points about the
# line.
#
# ## A piezoelectric half space
#
# PZT-4 is poled along the axis. If the sphere is an earthed conductor, charge flows between it and the body; if it
# insulates, the surface takes on a potential instead. Only the material and `conductivity` of the case change.


# %%
def pzt_sphere(conductivity):
    return meeframe.Case(
        title="Rigid sphere on PZT-4",
        material="pzt-4",
        mesh=meeframe.mesh.half_space("1.4 mm", divisions=40),
        formulation=meeframe.formulation("half-space"),
        indenter=meeframe.Sphere("100 mm"),
        conductivity=conductivity,
        steps=[meeframe.Step(approach="3 um")],
    )


conducting = pzt_sphere({"electric": meeframe.StepConductivity(np.inf)}).solve()
insulating = pzt_sphere({}).solve()

# %% [markdown]
# The closed form ([theory](../explanation/theory.md#half-space)) needs the response `xi` of the surface to point sources,
# which follows from the constants of the material.

# %%
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.testing.closed_forms import Sphere, indent

xi = axisymmetric_compliance(library_material("pzt-4").stiffness)
exact_conducting = indent(xi, Sphere(0.1), 3e-6, electric_potential=0.0)
exact_insulating = indent(xi, Sphere(0.1), 3e-6)

earthed, insulated = (
    run.to_dataframe().iloc[-1] for run in (conducting, insulating)
)
centre = abs(exact_insulating.electric_potential(np.array([0.0]))[0])
comparison = pd.DataFrame(
    {
        "meeframe": [
            earthed["normal_force"],
            earthed["charge"],
            insulated["normal_force"],
            insulated["max_abs_electric_potential"],
        ],
        "closed form": [
            exact_conducting.force,
            exact_conducting.charge,
            exact_insulating.force,
            centre,
        ],
    },
    index=[
        "conducting: force [N]",
        "conducting: charge [C]",
        "insulating: force [N]",
        "insulating: potential [V]",
    ],
)
comparison["deviation"] = comparison["meeframe"] / comparison["closed form"] - 1
comparison

# %%
print(
    f"largest deviation from the closed form: {comparison['deviation'].abs().max():.2%}"
)
assert comparison["deviation"].abs().max() < 2e-3

# %% [markdown]
# The whole potential agrees, too, inside and outside the contact. The conducting sphere fixes it to zero where they touch.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for run, closed, name in (
    (insulating, exact_insulating, "insulating"),
    (conducting, exact_conducting, "conducting"),
):
    fields = run.to_xarray().isel(increment=-1).sel(y=0, method="nearest")
    left.plot(
        1e3 * x, closed.electric_potential(abs(x)), label=f"{name}, closed form"
    )
    left.plot(
        1e3 * fields.x,
        fields["electric_potential"],
        "o",
        ms=3,
        label=f"{name}, meeframe",
    )
    right.plot(1e3 * x, 1e-6 * closed.pressure(abs(x)))
    right.plot(1e3 * fields.x, 1e-6 * fields["pressure"], "o", ms=3)
    potential = closed.electric_potential(np.abs(fields.x.values))
    deviation = np.abs(fields["electric_potential"] - potential).max() / centre
    print(f"{name}: potential deviates by {float(deviation):.2%} of the peak")
    assert deviation < 0.005
left.set(xlabel="x [mm]", ylabel="electric potential [V]")
left.legend(fontsize="small")
right.set(xlabel="x [mm]", ylabel="pressure [MPa]")

# %% [markdown]
# An open circuit stiffens the contact: at the same approach, the insulating sphere needs more force than the earthed one.

# %%
stiffening = insulated["normal_force"] / earthed["normal_force"] - 1
print(f"the insulating sphere needs {stiffening:.1%} more force")
assert stiffening > 0

# %% [markdown]
# ## Where to go next
#
# - [A piezoelectric force sensor](force-sensor.py) uses the coupling of this page
# - [Friction laws](friction-law.py) and [comparisons of laws, solvers and formulations](compare.py)
# - [Cases and results in Python](../tutorials/python.md) lists all arguments
# - [Verify a case](../howto/verify.md) where there is no closed form; [all checks of meeframe](../validation/checks.md)
