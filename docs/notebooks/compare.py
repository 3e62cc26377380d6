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
# # Compare laws, solvers and formulations
#
# This notebook changes one argument of a case at a time. You learn
#
# - how to make variants of a case,
# - how much friction laws differ in the same contact,
# - that all solvers find the same solution, and what they cost,
# - how far boundary elements, hierarchical matrices, finite elements and the half space agree, and why they differ.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import meeframe

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## The case
#
# A sphere is pressed against a piezoelectric and piezomagnetic half space and dragged.

# %%
case = meeframe.Case(
    title="Dragged sphere",
    material="batio3-cofe2o4",
    mesh=meeframe.mesh.half_space("4 mm", divisions=16),
    formulation=meeframe.formulation("half-space"),
    indenter=meeframe.Sphere("100 mm"),
    contact=meeframe.IsotropicCoulomb(0.3),
    steps=[
        meeframe.Step(approach="20 um", increments=4),
        meeframe.Step(translation=["6 um", 0], increments=4),
    ],
)
reference = case.solve()
reference

# %% [markdown]
# ## Laws
#
# `dataclasses.replace` returns a changed case, which is checked again.

# %%
laws = {
    "frictionless": meeframe.Signorini(),
    "Coulomb, 0.3": meeframe.IsotropicCoulomb(0.3),
    "Coulomb, 0.1": meeframe.IsotropicCoulomb(0.1),
    "orthotropic, 0.3 and 0.1": meeframe.OrthotropicCoulomb(0.3, 0.1),
    "capped at 150 MPa": meeframe.law("capped-coulomb", mu=0.3, limit="150 MPa"),
    "regularised, 2 um": meeframe.law(
        "regularised-coulomb", mu=0.3, slip_length="2 um"
    ),
}
by_law = {
    name: replace(case, contact=law).solve(progress=False)
    for name, law in laws.items()
}

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for marker, (name, result) in zip("osv^x+", by_law.items(), strict=True):
    dragged = result.to_dataframe().query("step == 2")
    x, force = 1e6 * dragged["translation_1"], 1e-3 * dragged["tangential_force_1"]
    left.plot(x, force, f"{marker}-", ms=4, label=name)
    section = result.to_xarray().isel(increment=-1).sel(y=0, method="nearest")
    right.plot(1e3 * section.x, 1e-6 * section["traction_x"], f"{marker}-", ms=4)
left.set(xlabel="translation [µm]", ylabel="tangential force [kN]")
right.set(xlabel="x [mm]", ylabel="tangential traction at the end [MPa]")
left.legend(fontsize="small")

# %%
last = pd.DataFrame(
    {name: result.to_dataframe().iloc[-1] for name, result in by_law.items()}
).T
forces = pd.DataFrame(
    {
        "normal force [N]": last["normal_force"].astype(float).round(1),
        "tangential force [N]": last["tangential_force_1"].astype(float).round(1),
        "stick area [mm²]": (1e6 * last["stick_area"].astype(float)).round(2),
        "dissipated energy [mJ]": (
            1e3 * last["dissipated_energy"].astype(float)
        ).round(3),
    }
)
forces

# %% [markdown]
# Friction changes the normal force by less than half a per cent here. Some of these numbers can be checked by reasoning: no law
# exceeds its limit, and with Coulomb's law and 0.1 the whole contact slides, at a tenth of the normal force.

# %%
normal, tangential = forces["normal force [N]"], forces["tangential force [N]"]
sliding = tangential["Coulomb, 0.1"] / normal["Coulomb, 0.1"]
print(f"tangential over normal force in sliding with 0.1: {sliding:.4f}")
assert abs(sliding - 0.1) < 1e-3
assert (tangential <= 0.3 * normal).all()
assert tangential["frictionless"] == 0
assert tangential["capped at 150 MPa"] < tangential["Coulomb, 0.3"]
assert normal.max() / normal.min() - 1 < 5e-3

# %% [markdown]
# ## Solvers
#
# All solvers end when the same independent residual is small enough, so their solutions must agree. They differ in the number of
# iterations, and in what each one costs. `projected-cg` is for frictionless contact and rejects this case.

# %%
runs = {}
for name in ("newton", "uzawa-bb", "uzawa-nesterov", "uzawa"):
    variant = replace(
        case,
        solver=meeframe.solver(name),
        stopping=meeframe.StoppingCriteria(tolerance=1e-8),
    )
    runs[name] = variant.solve(progress=False)

rows = {
    name: {
        "iterations": result.to_dataframe()["iterations"].sum(),
        "seconds": round(result.timings["contact"], 2),
        "tangential force [N]": result.to_dataframe()["tangential_force_1"].iloc[
            -1
        ],
    }
    for name, result in runs.items()
}
solvers = pd.DataFrame(rows).T
solvers["deviation"] = (
    solvers["tangential force [N]"] / solvers.loc["newton", "tangential force [N]"]
    - 1
)
solvers

# %%
print(f"largest deviation among solvers: {solvers['deviation'].abs().max():.1e}")
assert solvers["deviation"].abs().max() < 1e-6

try:
    replace(case, solver=meeframe.ProjectedCG()).solve()
except meeframe.MeeframeError as error:
    print(error)
else:
    raise AssertionError("projected-cg must refuse friction")

# %%
axes = plt.subplots(figsize=(6, 3.6), layout="constrained")[1]
for name, result in runs.items():
    history = result[4].history
    axes.semilogy(np.arange(1, len(history) + 1), history, ".-", label=name)
axes.set(
    xlabel="recorded iteration [1]",
    ylabel="residual [1]",
    title="first increment of the drag",
)
axes.legend()

# %% [markdown]
# `solver="auto"`, the default, starts with Newton's method and falls back to the others where it makes no progress.
#
# ## Formulations
#
# The half space has no other boundary. Boundary elements, their hierarchical matrices and finite elements need a body, here a
# block that is large compared with the contact. Two grids show the errors.


# %%
def indented(formulation, divisions):
    if formulation == "half-space":
        body = {"mesh": meeframe.mesh.half_space("4 mm", divisions=divisions)}
    else:
        sizes = {
            "divisions": divisions,
            "rings": divisions // 2 + 1,
            "layers": divisions // 2,
        }
        body = {
            "mesh": meeframe.mesh.block("50 mm", "120 mm", "4 mm", **sizes),
            "boundary": [
                meeframe.Boundary(
                    "base",
                    displacement=[0, 0, 0],
                    electric_potential=0,
                    magnetic_potential=0,
                )
            ],
        }
    return meeframe.Case(
        title=f"{formulation}, {divisions} divisions",
        material="batio3-cofe2o4",
        formulation=meeframe.formulation(formulation),
        indenter=meeframe.Sphere("100 mm"),
        steps=[meeframe.Step(approach="20 um")],
        **body,
    )


rows, finest = [], {}
for formulation in ("half-space", "dense-bem", "hmatrix-bem", "skfem"):
    for divisions in (6, 8):
        result = indented(formulation, divisions).solve(progress=False)
        totals = result.to_dataframe().iloc[-1]
        rows.append(
            (
                formulation,
                divisions,
                totals["normal_force"],
                totals["max_abs_electric_potential"],
            )
        )
        finest[formulation] = result
table = pd.DataFrame(
    rows, columns=["formulation", "divisions", "force [N]", "potential [V]"]
)
table = table.pivot(index="formulation", columns="divisions")
table.round(1)

# %% [markdown]
# The closed form for the half space shows which of them is right:

# %%
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.testing.closed_forms import Sphere, indent

exact = indent(
    axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness),
    Sphere(0.1),
    20e-6,
)
deviation = table["force [N]"] / exact.force - 1
print(f"closed form: {exact.force:.1f} N")
print(deviation.to_string(float_format="{:+.2%}".format))
fine = (
    indented("half-space", 40)
    .solve(progress=False)
    .to_dataframe()["normal_force"]
    .iloc[-1]
    / exact.force
    - 1
)
print(f"half-space with 40 divisions: {fine:+.2%}")
assert abs(deviation.loc[["half-space", "dense-bem"]]).to_numpy().max() < 0.015
assert abs(fine) < 2e-3
assert abs(deviation.loc["skfem", 8]) < abs(deviation.loc["skfem", 6]) < 0.05

forces = table["force [N]"]
compression = abs(forces.loc["hmatrix-bem"] / forces.loc["dense-bem"] - 1).max()
print(
    f"hierarchical against dense matrices of the same elements: {compression:.1e}"
)
assert compression < 1e-4
block = abs(forces.loc["dense-bem"] / forces.loc["half-space"] - 1).max()
print(f"block against half space on the same contact zone: {block:.2%}")
assert block < 3e-3

# %% [markdown]
# - The **half space** represents the body exactly, so only the grid of the contact matters. It is by far the fastest, and a finer grid
#   costs little.
# - **Dense boundary elements** model the finite block, whose influence on the force is small: with the same contact zone they
#   deviate from the half space much less than both deviate from the closed form. **Hierarchical matrices** store the same equations
#   approximately, for bodies with many more nodes.
# - **Finite elements** of the lowest order are too stiff, by an amount that decreases on finer grids. They suit slender bodies, where
#   boundary elements lose accuracy.

# %%
axes = plt.subplots(figsize=(6, 3.6), layout="constrained")[1]
radius = np.linspace(-2e-3, 2e-3, 400)
axes.plot(
    1e3 * radius,
    1e-6 * exact.pressure(abs(radius)),
    "k-",
    lw=1,
    label="closed form",
)
for marker, (formulation, result) in zip("osx+", finest.items(), strict=True):
    section = (
        result.to_xarray()["pressure"].isel(increment=-1).sel(y=0, method="nearest")
    )
    axes.plot(1e3 * section.x, 1e-6 * section, marker, label=formulation)
axes.set(xlabel="x [mm]", ylabel="pressure [MPa]")
axes.legend()

# %% [markdown]
# ## Where to go next
#
# - `meeframe compare` does the same for case files, in one command, and shares the reduced systems ([tutorial](../tutorials/first-friction-law.md#run-a-case))
# - [Choose a formulation](../howto/troubleshooting.md#choose-a-formulation)
# - [Verify a case](../howto/verify.md) on several grids with several formulations, where there is no closed form
# - [Solvers](../explanation/solvers.md) and their [performance](../validation/performance.md)
