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
# # Figures of the reference paper
#
# Section 7.1 of the [reference paper](../explanation/theory.md) presses a rigid sphere into a transversely isotropic
# magneto-electro-elastic block and sweeps the conductivity of the contact from insulating to conducting. This notebook computes its
# figures 3 and 4 from the main case of meeframe. You learn
#
# - to load the case that ships with meeframe and change it,
# - how conductivity enters the contact, and what the four limits are called,
# - how closely a finite block and a coarse mesh follow the half space in closed form.

# %%
from dataclasses import replace
from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import meeframe
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.testing.closed_forms import CONDITIONS, Sphere, indent

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## The main case
#
# The paper has 16 x 16 elements in the contact zone, 1088 in total. This notebook uses 12 x 12, so that it runs quickly; remove `replace`
# for the mesh of the paper.

# %%
main = meeframe.Case.from_toml(files("meeframe") / "examples" / "emii.toml")
main = replace(
    main,
    mesh=meeframe.mesh.block(
        "50 mm", "120 mm", "5 mm", divisions=12, rings=6, layers=2
    ),
    solver=meeframe.Auto(),
)
main

# %% [markdown]
# ## Four conditions
#
# The contact insulates (I) or conducts (C) electrically (E) and magnetically (M): EMII insulates both fields, EMCI conducts both. The closed forms for the half space are equations 33 to 36
# of the paper.

# %%
CONDUCTS = {
    "EMII": [],
    "ECMII": ["electric"],
    "EIMCI": ["magnetic"],
    "EMCI": ["electric", "magnetic"],
}
xi = axisymmetric_compliance(main.checked.material.stiffness)
exact = {
    name: indent(xi, Sphere(0.1), 50e-6, *CONDITIONS[name]) for name in CONDUCTS
}
conditions = meeframe.sweep(
    main,
    {
        "condition": {
            name: {
                f"conductivity.{field}": {"name": "step", "kappa": np.inf}
                for field in conducting
            }
            for name, conducting in CONDUCTS.items()
        }
    },
    progress=False,
)
assert (conditions["status"] == "converged").all()

table = pd.DataFrame(
    {
        "force [N]": conditions["normal_force"],
        "exact [N]": [form.force for form in exact.values()],
        "charge [µC]": 1e6 * conditions["charge"],
        "exact [µC]": [1e6 * form.charge for form in exact.values()],
        "flux [µWb]": 1e6 * conditions["magnetic_flux"],
        "exact [µWb]": [1e6 * form.magnetic_flux for form in exact.values()],
    },
    index=list(CONDUCTS),
)
table.round(3)

# %%
deviation = table["force [N]"] / table["exact [N]"] - 1
emci = table.loc["EMCI"]
charge = emci["charge [µC]"] / emci["exact [µC]"] - 1
flux = emci["flux [µWb]"] / emci["exact [µWb]"] - 1
print(f"force {abs(deviation).max():.2%}, charge {charge:.2%}, flux {flux:.2%}")
assert abs(deviation).max() < 0.015
assert abs(charge) < 0.02
assert abs(flux) < 0.03

# %% [markdown]
# ## Figure 3: from insulating to conducting
#
# The flux through the contact is $q = \kappa\,(\varphi - \varphi_o)$. As $\kappa$ grows, force and charge (or magnetic flux) tend to
# those of perfect conduction, shown dashed. The limits themselves, 0 and infinity, are computed for figure 4.

# %%
LEVELS = {
    "electric": [0.0, *np.geomspace(1e-8, 1e-2, 9).tolist(), np.inf],
    "magnetic": [0.0, *np.geomspace(3e-4, 3e2, 9).tolist(), np.inf],
}
SECTIONS = ["pressure", "electric_potential", "magnetic_potential"]


def conductivity_sweep(field, values):
    case = replace(main, conductivity={field: meeframe.StepConductivity(0.0)})
    axes = {"kappa": {f"conductivity.{field}.kappa": values}}
    return meeframe.sweep(case, axes, fields=SECTIONS, progress=False)


runs = {
    field: conductivity_sweep(field, values) for field, values in LEVELS.items()
}
swept = {field: run.isel(kappa=slice(1, -1)) for field, run in runs.items()}

figure, panels = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for panel, field, condition, total, letter, unit in (
    (panels[0], "electric", "ECMII", "charge", "Q", "F/m²"),
    (panels[1], "magnetic", "EIMCI", "magnetic_flux", "M", "H/m²"),
):
    curve, limit = swept[field], exact[condition]
    panel.semilogx(
        curve["kappa"],
        curve["normal_force"] / exact["EMII"].force,
        "o-",
        label="P / P of EMII",
    )
    panel.semilogx(
        curve["kappa"],
        curve[total] / getattr(limit, total),
        "s-",
        label=f"{letter} / {letter} of {condition}",
    )
    panel.axhline(limit.force / exact["EMII"].force, color="0.5", ls="--", lw=1)
    panel.axhline(1.0, color="0.5", ls="--", lw=1)
    panel.set(
        xlabel=f"{field} conductivity [{unit}]",
        ylabel="relative to the closed form [1]",
        title=condition,
    )
    panel.legend()

# %%
for field, condition, total in (
    ("electric", "ECMII", "charge"),
    ("magnetic", "EIMCI", "magnetic_flux"),
):
    curve, limit = swept[field], exact[condition]
    values = curve[total] / getattr(limit, total)
    print(
        f"{condition}: {total} from {float(values[0]):.3f} to "
        f"{float(values[-1]):.3f} of the closed form"
    )
    assert (curve["status"] == "converged").all()
    assert (values.diff("kappa") > 0).all()
    assert values[0] < 0.05
    assert abs(values[-1] - 1) < 0.03
    assert abs(curve["normal_force"][-1] / limit.force - 1) < 0.015

# %% [markdown]
# ## Figure 4: distributions
#
# Sections through the contact for a few conductivities, relative to the centre of the insulated half space in closed form. The potential of the
# conducting field tends to the prescribed zero; the other one stays, because this material hardly couples electric and magnetic fields.

# %%
centre = {
    "pressure": exact["EMII"].pressure(np.array([0.0]))[0],
    "electric_potential": exact["EMII"].electric_potential(np.array([0.0]))[0],
    "magnetic_potential": exact["EMII"].magnetic_potential(np.array([0.0]))[0],
}
sections = {field: run.isel(kappa=[0, 4, 5, 6, -1]) for field, run in runs.items()}

x = np.linspace(-2.5e-3, 2.5e-3, 300)
figure, panels = plt.subplots(
    3, 2, figsize=(9, 9), sharex=True, layout="constrained"
)
for column, (field, condition) in zip(
    panels.T, (("electric", "ECMII"), ("magnetic", "EIMCI")), strict=True
):
    column[0].set_title(condition)
    for panel, name in zip(column, SECTIONS, strict=True):
        for closed, style in ((exact["EMII"], "-"), (exact[condition], "--")):
            panel.plot(
                1e3 * x,
                getattr(closed, name)(abs(x)) / centre[name],
                style,
                color="0.5",
                lw=1,
            )
        values = sections[field][f"zone_{name}"].sel(y=0, method="nearest")
        for marker, section in zip("os^vx", values, strict=True):
            panel.plot(
                1e3 * section.x,
                section / centre[name],
                marker,
                ms=4,
                label=f"κ = {float(section.kappa):.2g}",
            )
        panel.set_ylabel(f"{name.replace('_', ' ')} [1]")
    column[0].legend(fontsize="small")
    column[2].set_xlabel("x [mm]")

# %%
for field, own, other in (
    ("electric", "electric_potential", "magnetic_potential"),
    ("magnetic", "magnetic_potential", "electric_potential"),
):
    peak = abs(sections[field][f"zone_{own}"]).max(["x", "y"])
    inside = abs(sections[field][f"zone_{own}"].sel(x=0, y=0, method="nearest"))
    change = sections[field][f"zone_{other}"].sel(x=0, y=0, method="nearest")
    print(
        f"{field} conduction, at the centre: {own} "
        f"{(inside / peak[0]).values.round(3)}, "
        f"{other} {(change / change[0]).values.round(3)}"
    )
    assert (inside.diff("kappa") < 0).all()
    assert inside[-1] < 1e-6 * peak[0]
    assert abs(change / change[0] - 1).max() < 0.1

# %% [markdown]
# ## Where to go next
#
# - [Section 7.1](../validation/transversely_isotropic_indentation.md) on the mesh of the paper, with convergence to the half space
# - [Sections 7.2 to 7.4](../validation/orthotropic.md): figures 5 to 14, orthotropic material and friction
# - [Reproduce figures](../howto/reproduce.md): the same with `meeframe reproduce`
