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
# # A parameter sweep with xarray
#
# One case is solved for all combinations of a friction coefficient and a radius. You learn
#
# - to sweep over any keys of a case with one call,
# - to select, plot and combine the results by name with xarray,
# - to find the dimensionless curve on which all of them lie.

# %%
import matplotlib.pyplot as plt
import numpy as np

import meeframe

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## The case

# %%
case = meeframe.Case(
    title="Dragged sphere",
    material={
        "name": "isotropic",
        "young_modulus": "210 GPa",
        "poisson_ratio": 0.4999,
    },
    mesh=meeframe.mesh.half_space("1.6 mm", divisions=28),
    formulation=meeframe.formulation("half-space"),
    indenter=meeframe.Sphere("100 mm"),
    contact=meeframe.IsotropicCoulomb(0.3),
    steps=[
        meeframe.Step(approach="2 um"),
        meeframe.Step(translation=["0.9 um", 0], increments=6),
    ],
)

# %% [markdown]
# ## The sweep
#
# Keys are those of case files, as `case.to_toml()` writes them. Each axis gets a short name here. With a folder as third argument, the
# results of all points are stored, and an interrupted sweep continues where it stopped.

# %%
sweep = meeframe.sweep(
    case,
    {
        "mu": {"contact.law.mu": [0.1, 0.2, 0.4]},
        "radius": {"indenter.radius": ["50 mm", "100 mm", "200 mm"]},
    },
    every_increment=True,
    progress=False,
)
sweep[
    ["normal_force", "tangential_force_1", "translation_1", "stick_area", "status"]
]

# %% [markdown]
# The axes are dimensions of the dataset, with numbers in SI units as coordinates. Units are attributes.

# %%
assert (sweep["status"] == "converged").all()
force = sweep["normal_force"]
print(f"{force.attrs['long_name']} [{force.attrs['units']}]: {dict(force.sizes)}")

# %% [markdown]
# ## Select by value
#
# Select a section of the dataset, and fit a power along one of its dimensions: according to Hertz, the force at a given approach grows
# with the square root of the radius.

# %%
at_end = force.isel(increment=-1)
exponents = np.polyfit(
    np.log(sweep["radius"]), np.log(at_end.transpose("radius", "mu")), 1
)[0]
print("P ~ R^n with n =", exponents.round(3))
assert abs(exponents - 0.5).max() < 0.02

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for marker, mu in zip("os^", sweep["mu"].values, strict=True):
    one = sweep.sel(mu=mu, radius=0.1, method="nearest")
    label = f"friction coefficient {mu:g}"
    left.plot(
        1e6 * one["translation_1"],
        one["tangential_force_1"],
        f"{marker}-",
        label=label,
    )
    one = sweep.sel(mu=mu, method="nearest").isel(increment=3)
    right.plot(
        1e3 * one["radius"], 1e6 * one["stick_area"], f"{marker}-", label=label
    )
left.set(
    xlabel="translation [µm]", ylabel="tangential force [N]", title="R = 100 mm"
)
left.legend()
translation = 1e6 * float(sweep["translation_1"].isel(increment=3).max())
right.set(
    xlabel="radius [mm]",
    ylabel="stick area [mm²]",
    title=f"translation {translation:.2f} µm",
)

# %% [markdown]
# ## One curve for all
#
# Arithmetic with datasets aligns the dimensions by their names. Divide the tangential force by $\mu P$ and the translation by
# that of full slip, $\delta_s = 3 \mu P (2 - \nu)/(16\, G a)$: all points fall on the curve of Cattaneo and Mindlin,
# $1 - (1 - \delta/\delta_s)^{3/2}$.

# %%
shear_modulus, poisson = 210e9 / (2 * 1.4999), 0.4999
contact_radius = (sweep["radius"] * sweep["approach"]) ** 0.5
limit = sweep["mu"] * sweep["normal_force"]
full_slip = 3 * limit * (2 - poisson) / (16 * shear_modulus * contact_radius)

share = sweep["tangential_force_1"] / limit
slip = sweep["translation_1"] / full_slip
exact = 1 - (1 - slip.clip(0, 1)) ** 1.5
deviation = abs(share - exact)
print(f"largest deviation from the curve {float(deviation.max()):.3f}")
assert deviation.max() < 0.03

axes = plt.subplots(figsize=(6, 4), layout="constrained")[1]
x = np.linspace(0, 1, 100)
axes.plot(
    np.append(x, 4),
    np.append(1 - (1 - x) ** 1.5, 1),
    "k-",
    lw=1,
    label="Cattaneo, Mindlin",
)
for marker, mu in zip("os^", sweep["mu"].values, strict=True):
    points = {"mu": mu, "method": "nearest"}
    axes.plot(
        slip.sel(**points).values.ravel(),
        share.sel(**points).values.ravel(),
        marker,
        label=f"{mu:g}, three radii",
    )
axes.set(
    xlabel="translation / translation of full slip [1]",
    ylabel="tangential force / (µP) [1]",
    xlim=(0, 4),
)
axes.legend()

# %% [markdown]
# ## Other axes
#
# An axis may also have labels for changes of several keys, such as laws. Values can be spaced linearly or logarithmically.

# %%
laws = meeframe.sweep(
    case,
    {
        "law": {
            "Coulomb": {"contact.law": {"name": "isotropic-coulomb", "mu": 0.3}},
            "frictionless": {"contact.law": "signorini"},
        },
        "steps[1].approach": {"from": 1e-6, "to": 2e-6, "count": 2},
    },
    progress=False,
)
table = laws["tangential_force_1"].to_pandas()
table.columns = [f"approach {1e6 * approach:g} µm" for approach in table.columns]
table

# %%
assert (table.loc["frictionless"] == 0).all()
assert (table.loc["Coulomb"] > 0).all()

# %% [markdown]
# ## Where to go next
#
# - [Sweep parameters](../howto/sweep.md): study files for the command line, resuming, clusters
# - [Reproduce figures](../howto/reproduce.md) of studies
# - [The figures of the paper](paper-figures.py)
