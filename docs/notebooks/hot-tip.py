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
# # A hot tip on a pyroelectric
#
# A hot, conducting tip presses on poled barium titanate. Heat flows into the body, which expands and is polarised. You learn
#
# - to prescribe the temperature of an indenter, and to read heat flow and thermal conductance,
# - which charge or voltage a hot tip collects, and what it depends on,
# - to tell the pyroelectric part from the piezoelectric one,
# - to compare laws of thermal conductance in a sweep,
# - how the charge of a film on a substrate differs from that of a thick body.
#
# **Not covered:** transients, and the change of the constants with temperature. Barium titanate loses its polarisation near 120
# °C, so the tip is at most 60 K warmer than the body.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from scipy.optimize import brentq

import meeframe
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.material.thermal_half_space import thermal_response
from meeframe.testing.closed_forms import Sphere
from meeframe.testing.closed_forms_heat import HotIndentation

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## The case
#
# `thermal=True` takes the [thermal constants of the library](../reference/materials.md#heat). The tip, a sphere, first presses
# with a force of 50 mN, then it is heated. Under steady heat flow into a half space, displacement and potential are undetermined by a
# constant. `reference_radius` states the approximate distance at which the body is held and earthed. Charges and heat fluxes are
# singular at the contact edge, so the edge is resolved between the nodes.

# %%
RADIUS, FORCE, TEMPERATURE, DISTANCE = 1e-3, 0.05, 60.0, 1e-3
ceramic = library_material("batio3", thermal=True)
PERFECT = meeframe.StepConductivity(np.inf)
HELD_FORCE = meeframe.Step(normal_force=FORCE)


def hot_tip(material=ceramic, first=HELD_FORCE, distance=DISTANCE, increments=3):
    """Return the case of a tip that is pressed against the body, then heated."""
    return meeframe.Case(
        title="Hot tip",
        material=material,
        mesh=meeframe.mesh.half_space("18 um", divisions=24),
        formulation=meeframe.formulation(
            "half-space", edges="resolved", reference_radius=distance
        ),
        indenter=meeframe.Sphere(RADIUS),
        conductivity={"electric": PERFECT, "thermal": PERFECT},
        steps=[
            first,
            meeframe.Step(temperature=TEMPERATURE, increments=increments),
        ],
    )


def solve(*arguments, **options):
    """Return the table of the increments of a case."""
    return hot_tip(*arguments, **options).solve(progress=False).to_dataframe()


earthed = solve()
floating = solve(first=replace(HELD_FORCE, charge=0))
print(
    {name: earthed.attrs["units"][name] for name in ("heat", "thermal_conductance")}
)
earthed[
    ["temperature", "heat", "thermal_conductance", "charge", "approach", "status"]
]

# %% [markdown]
# Heat and charge are positive out of the body, so heat from a hot tip is negative. While the force is constant, expansion pushes
# the tip back: the approach decreases.
#
# ## Held force or held approach
#
# The third tip is held at the approach it has when cold. Expansion then raises the force.

# %%
cold = earthed.iloc[0]
held = solve(first=meeframe.Step(approach=cold["approach"]))

figure, axes = plt.subplots(2, 2, figsize=(9, 6), layout="constrained", sharex=True)
curves = {
    "force held, earthed": earthed,
    "force held, floating": floating,
    "approach held, earthed": held,
}
for marker, (name, curve) in zip("os^", curves.items(), strict=True):
    warm, style = curve["temperature"], f"{marker}-"
    axes[0, 0].plot(warm, 1e3 * curve["normal_force"], style, label=name)
    axes[0, 1].plot(warm, -1e3 * curve["heat"], style)
    axes[1, 0].plot(warm, 1e12 * curve["charge"], style)
    axes[1, 1].plot(warm, curve["electric_potential"], style)
axes[0, 0].set(ylabel="force [mN]")
axes[0, 1].set(ylabel="heat into the body [mW]")
axes[1, 0].set(
    ylabel="charge out of the body [pC]", xlabel="temperature of the tip [K]"
)
axes[1, 1].set(
    ylabel="potential of the tip [V]", xlabel="temperature of the tip [K]"
)
axes[0, 0].legend()

# %% [markdown]
# ## The closed form
#
# A hot sphere in perfect contact has a [solution in closed form](../explanation/heat.md#contact) for each contact radius $a$.
# Here the radius follows from the force or the approach. The conductance is that of a disc, $4a\kappa$ with $\kappa =
# \sqrt{k_{11}k_{33}}$, and its reciprocal the constriction resistance.


# %%
def surface(material):
    """Return point response, distortivity and conductivity of the surface."""
    coupled, conductivity = material.stiffness[:, :5, :5], material.decoupled[0][1]
    heat, kappa = thermal_response(
        coupled, material.thermal_moduli, conductivity, (0, 0, 1), [(1.0, 0, 0)]
    )
    return axisymmetric_compliance(coupled), -heat[0, 2:].real, float(kappa[0])


def exact(material, temperature, potential=0.0, approach=None, distance=DISTANCE):
    """Return the closed form for the force, or for an approach."""
    made = surface(material)

    def of_radius(a):
        return HotIndentation(
            *made, Sphere(RADIUS), a, temperature, (potential, None), distance
        )

    def excess(a):
        form = of_radius(a)
        if approach is None:
            return form.force / FORCE - 1
        return form.solved_approach / approach - 1

    return of_radius(brentq(excess, 2e-6, 20e-6))


def exact_potential(material, temperature, distance=DISTANCE):
    """Return the potential at which the tip has no charge."""
    return brentq(
        lambda potential: exact(
            material, temperature, potential, distance=distance
        ).totals[1],
        -100,
        100,
    )


form, at_approach = (
    exact(ceramic, TEMPERATURE),
    exact(ceramic, TEMPERATURE, approach=cold["approach"]),
)
hot = earthed.iloc[-1]
checks = pd.DataFrame(
    {
        "cold: charge [C]": (cold["charge"], exact(ceramic, 0.0).totals[1]),
        "conductance [W/K]": (
            hot["thermal_conductance"],
            4 * form.contact_radius * form.conductivity,
        ),
        "heat [W]": (hot["heat"], form.heat),
        "charge [C]": (hot["charge"], form.totals[1]),
        "approach [m]": (hot["approach"], form.solved_approach),
        "floating: potential [V]": (
            floating["electric_potential"].iloc[-1],
            exact_potential(ceramic, TEMPERATURE),
        ),
        "approach held: force [N]": (
            held["normal_force"].iloc[-1],
            at_approach.force,
        ),
        "approach held: charge [C]": (
            held["charge"].iloc[-1],
            at_approach.totals[1],
        ),
    },
    index=["computed", "closed form"],
).T
checks["deviation"] = checks["computed"] / checks["closed form"] - 1
print(checks.to_string(float_format="{:.4g}".format))
assert abs(checks["deviation"]).max() < 5e-3

# %% [markdown]
# ## Pyroelectric and piezoelectric part
#
# The charge of the hot tip has three causes: the force; the expansion, whose stresses polarise a piezoelectric body; and the
# pyroelectric effect itself. A material without pyroelectric coefficients has only the first two. In `thermal_moduli`, (3, 5),
# the coefficients are the fourth column, at constant strain and with the sign changed.

# %%
moduli = ceramic.thermal_moduli.copy()
print(f"p3 = {-1e6 * moduli[2, 3]:.0f} uC/(m^2 K)")
moduli[:, 3] = 0.0
expanding = replace(ceramic, thermal_moduli=moduli)
without = solve(expanding, increments=1).iloc[-1]
parts = pd.Series(
    {
        "force": cold["charge"],
        "expansion": without["charge"] - cold["charge"],
        "pyroelectric": hot["charge"] - without["charge"],
    }
)
print((1e12 * parts).round(2).to_string())

# %% [markdown]
# Expansion acts against the force here and removes about half of the pyroelectric part. The parts are almost additive:
# half of the pyroelectric coefficient has half of the effect, except for a small change of the contact radius.

# %%
half = replace(ceramic, thermal_moduli=(moduli + ceramic.thermal_moduli) / 2)
of_half = solve(half, increments=1).iloc[-1]["charge"] - without["charge"]
print(f"half of p3: {of_half / parts['pyroelectric']:.4f} of the pyroelectric part")
assert abs(of_half / parts["pyroelectric"] - 0.5) < 2e-3

expected = exact(expanding, TEMPERATURE).totals[1]
assert abs(without["charge"] / expected - 1) < 5e-3
assert parts["pyroelectric"] < 0 < parts["expansion"]

# %% [markdown]
# ## How far is earth?
#
# The potential of a floating tip depends on the size of the specimen: it grows as $\ln R$ with the distance $R$ at which the body is
# earthed. With the heat $H$ into the body and the distortivity $\delta_\varphi$ of the potential, a distance ten times as large
# changes the potential by $\delta_\varphi H \ln 10/2\pi$. Heat, pressure and contact do not depend on $R$.

# %%
farther = solve(
    first=replace(HELD_FORCE, charge=0), distance=10 * DISTANCE, increments=1
).iloc[-1]
near = floating.iloc[-1]
shift = farther["electric_potential"] - near["electric_potential"]
expected = form.distortivity[1] * -near["heat"] * np.log(10) / (2 * np.pi)
print(f"shift of the potential {shift:.4f} V, expected {expected:.4f} V")
assert abs(shift / expected - 1) < 1e-3
assert abs(farther["heat"] / near["heat"] - 1) < 1e-6

# %% [markdown]
# ## Laws of thermal conductance
#
# Real surfaces are rough or covered by films, and conduct less. [Conductivity laws](../reference/laws-conductivity.md) describe
# that in `[conductivity.thermal]`. A sweep compares them, as an axis with a label for each law.

# %%
FILM, PRESSURE = 5e5, 3.5e8  # [W/(m^2 K)], [Pa]
LAWS = {
    "perfect": {"name": "step", "kappa": np.inf},
    "film": {"name": "step", "kappa": FILM},
    "rough": {
        "name": "power-law",
        "reference_conductivity": FILM,
        "reference_pressure": PRESSURE,
    },
    "soft asperities": {
        "name": "saturating",
        "largest_conductivity": FILM,
        "saturation_pressure": PRESSURE,
    },
}
sweep = meeframe.sweep(
    hot_tip(increments=1),
    {
        "law": {name: {"conductivity.thermal": law} for name, law in LAWS.items()},
        "force": {"steps[1].normal_force": [0.02, 0.05]},
    },
    fields=["pressure", "temperature"],
    progress=False,
)
assert (sweep["status"] == "converged").all()
sweep

# %%
heat, charge = (
    -sweep["heat"],
    sweep["charge"] - cold["charge"] * sweep["force"] / FORCE,
)
laws = xr.Dataset(
    {
        "heat into the body [mW]": 1e3 * heat,
        "resistance [K/W]": 1 / sweep["thermal_conductance"],
        "charge without that of the force [pC]": 1e12 * charge,
        "charge over heat [pC/mW]": 1e9 * charge / heat,
    }
).drop_vars("z")
laws.to_dataframe().round(3)

# %% [markdown]
# Each law lets a different amount of heat through. The charge that heat adds to that of the force is proportional to it: the ratio
# hardly depends on the law, because the place at which heat enters a small contact has little effect far away.

# %%
ratio = charge / heat
spread = abs(ratio / ratio.sel(law="perfect") - 1).max("law")
print("largest difference of charge over heat:", spread.values.round(3))
assert spread.max() < 0.03
assert (heat.sel(law="perfect") > 1.5 * heat.drop_sel(law="perfect")).all()

# %% [markdown]
# ## Interface and constriction in series
#
# The resistance of the contact is between two bounds. Heat would flow more easily if a sheet of a perfect conductor lay below the
# interface: the sum of both resistances, $1/4a\kappa + 1/\int\kappa_h\,dA$, is a lower bound. It would flow less easily if its
# flux were proportional to $\kappa_h$ everywhere. The upper bound therefore has a larger constriction resistance: $8/3\pi^2a\kappa$ for
# the uniform flux through a film, and at most $3/10a\kappa$, that of a flux proportional to the pressure, for the other laws. The
# contact radius is between that of the perfectly conducting and that of the cold contact.

# %%
at_force = sweep.sel(force=FORCE)
largest, smallest = exact(ceramic, 0.0).contact_radius, form.contact_radius
relative = at_force["zone_pressure"] / PRESSURE
area = float(sweep.x[1] - sweep.x[0]) ** 2  # of a node
interface = {  # smallest and largest conductance [W/K]
    "film": (FILM * np.pi * smallest**2, FILM * np.pi * largest**2),
    "rough": (FILM * area * float((relative.sel(law="rough") ** 0.95).sum()),) * 2,
    "soft asperities": (
        FILM
        * area
        * float((1 - np.exp(-relative.sel(law="soft asperities"))).sum()),
    )
    * 2,
}
rows = {}
for name, (least, most) in interface.items():
    most_constricted = 8 / (3 * np.pi**2) if name == "film" else 0.3
    rows[name] = {
        "lower bound [K/W]": 1 / (4 * largest * form.conductivity) + 1 / most,
        "computed [K/W]": 1 / float(at_force["thermal_conductance"].sel(law=name)),
        "upper bound [K/W]": most_constricted / (smallest * form.conductivity)
        + 1 / least,
    }
bounds = pd.DataFrame(rows).T
print(bounds.round(0).to_string())
assert (bounds["lower bound [K/W]"] < bounds["computed [K/W]"]).all()
assert (bounds["computed [K/W]"] < bounds["upper bound [K/W]"]).all()

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for name in LAWS:
    section = at_force["zone_temperature"].sel(law=name).sel(y=0, method="nearest")
    left.plot(1e6 * section.x, section, "o-", ms=3, label=name)
left.set(xlabel="x [µm]", ylabel="temperature of the surface [K]")
left.legend(fontsize="small")
middle = 1e-3 * bounds["computed [K/W]"]
edges = 1e-3 * bounds[["lower bound [K/W]", "upper bound [K/W]"]].to_numpy().T
right.errorbar(
    range(len(bounds)), middle, abs(edges - middle.to_numpy()), fmt="o", capsize=6
)
right.set_xticks(range(len(bounds)), bounds.index)
right.set(ylabel="resistance, with bounds [K/mW]")

# %% [markdown]
# ## A film on silicon
#
# A film collects a different charge. Here the film is on silicon, which conducts heat sixty times as well, with a grounded electrode
# between them. For a library material without thermal constants, `with_heat` defines them.

# %%
silicon = library_material("silicon").with_heat(148.0, 2.6e-6)  # W/(m K), 1/K


def hot_film(thickness):
    """Return the table of a film of some thickness, or of a thick ceramic for None."""
    electrode = meeframe.Interface(electrode="grounded")
    layers = [meeframe.Layer(ceramic, thickness, interface=electrode)]
    case = meeframe.Case(
        material=ceramic if thickness is None else silicon,
        layers=[] if thickness is None else layers,
        mesh=meeframe.mesh.half_space("18 um", divisions=48),
        formulation=meeframe.formulation("half-space", reference_radius=DISTANCE),
        indenter=meeframe.Sphere(RADIUS),
        conductivity={"electric": PERFECT, "thermal": PERFECT},
        steps=[HELD_FORCE, meeframe.Step(temperature=TEMPERATURE)],
    )
    return case.solve(progress=False).to_dataframe()


thicknesses = [0.3e-6, 1e-6, 3e-6, 10e-6, 30e-6, 100e-6, 1e-3]
thick, *films = [hot_film(thickness) for thickness in (None, *thicknesses)]


def by_heating(table, name):
    """Return by how much heating changes a quantity."""
    return table[name].iloc[-1] - table[name].iloc[0]


film_charge = np.array([by_heating(table, "charge") for table in films])
film_heat = -np.array([table["heat"].iloc[-1] for table in films])

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.loglog(1e6 * np.array(thicknesses), 1e3 * film_heat, "o-")
left.axhline(-1e3 * thick["heat"].iloc[-1], ls="--", color="gray")
left.set(xlabel="thickness of the film [µm]", ylabel="heat into the body [mW]")
right.semilogx(1e6 * np.array(thicknesses), 1e12 * film_charge, "o-")
right.axhline(
    1e12 * by_heating(thick, "charge"), ls="--", color="gray", label="thick ceramic"
)
right.set(xlabel="thickness of the film [µm]", ylabel="charge by heating [pC]")
right.legend()

# %% [markdown]
# The silicon cools a thin film: much heat flows, but little of it changes the temperature of the film. There the charge even has
# the opposite sign, because the heated silicon and the clamped film expand upwards and press on the tip. On thicker films the
# pyroelectric part prevails. It does not end at the width of the contact: the electrode is where the film is earthed, and the
# charge grows with the logarithm of its depth. A film as thick as the distance at which the thick ceramic is earthed has about the
# same charge. The reference radius has no effect on charge and potential above an electrode, only on the approach.

# %%
assert abs(film_heat[-1] / -thick["heat"].iloc[-1] - 1) < 0.01
assert abs(film_charge[-1] / by_heating(thick, "charge") - 1) < 0.05
assert (np.diff(film_heat) < 0).all()
assert (np.diff(film_charge) < 0).all()
assert film_charge[0] > 0
print("charge of a film of 1 mm, per that of a thick ceramic:")
print(f"{film_charge[-1] / by_heating(thick, 'charge'):.3f}")

# %% [markdown]
# ## Where to go next
#
# - [Heat](../explanation/heat.md): equations, signs, and why a tip *colder* than the body has no solution with perfect contact
# - [Conductivity laws](../reference/laws-conductivity.md) and [contact resistance](../howto/contact-resistance.md)
# - [A piezoelectric force sensor](force-sensor.py): charge and voltage without heat
# - [Frictional heating of a slider](frictional-heating.py): heat that arises in the contact
# - `meeframe compare` compares laws of a case file in one command. A table names the law of each field:
#   `--conductivity-law '{electric = {name = "step", kappa = inf}, thermal = {name = "step", kappa = 5e5}}'`
