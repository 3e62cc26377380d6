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
# # A piezoelectric force sensor
#
# A conducting indenter presses on a poled piezoceramic, PZT-5H. In a short circuit, charge flows; in an open circuit, a voltage
# arises. You learn
#
# - to prescribe the potential or the charge of an electrode, together with a force,
# - that charge per force is a constant of the material, whatever the shape of the indenter,
# - that voltage per force depends on the shape, and is constant only under a punch,
# - how thickness changes the sensitivity of a plate that is bonded to a rigid, earthed base.
#
# **Not covered:** a film on an elastic substrate; see [the next notebook](film-on-substrate.py).

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import meeframe
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.testing.closed_forms import FlatPunch, indent

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## Short circuit and open circuit
#
# Each load step prescribes a force, and either the potential of the indenter (zero by default) or its charge. Without charge, the
# indenter floats and its potential is a result. Charges are singular at the contact edge, so the edge is resolved between the
# nodes.

# %%
INDENTERS = {
    "flat punch, a = 1 mm": (meeframe.FlatPunch("1 mm"), "2.4 mm"),
    "sphere, R = 100 mm": (meeframe.Sphere("100 mm"), "1.6 mm"),
    "sphere, R = 400 mm": (meeframe.Sphere("400 mm"), "2.4 mm"),
}


def press(indenter, width, **circuit):
    case = meeframe.Case(
        title="Force sensor",
        material="pzt-5h",
        mesh=meeframe.mesh.half_space(width, divisions=40),
        formulation=meeframe.formulation("half-space", edges="resolved"),
        indenter=indenter,
        conductivity={"electric": meeframe.StepConductivity(np.inf)},
        steps=[meeframe.Step(normal_force="100 N", increments=5, **circuit)],
    )
    return case.solve(progress=False)


short = {name: press(*made) for name, made in INDENTERS.items()}
floating = {name: press(*made, charge=0) for name, made in INDENTERS.items()}

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for marker, name in zip("so^", INDENTERS, strict=True):
    charge, voltage = short[name].to_dataframe(), floating[name].to_dataframe()
    left.plot(
        charge["normal_force"], 1e9 * charge["charge"], f"{marker}-", label=name
    )
    right.plot(voltage["normal_force"], voltage["electric_potential"], f"{marker}-")
left.set(
    xlabel="force [N]", ylabel="charge out of the body [nC]", title="short circuit"
)
right.set(xlabel="force [N]", ylabel="potential [V]", title="open circuit")
left.legend()

# %% [markdown]
# ## Charge per force
#
# The three charges coincide. The closed form explains why: at zero potential, pressure and flux have the same distribution, in a
# ratio that follows from the response $\xi$ of displacement and potential to a point source,
#
# $$\frac{Q}{P} = -\frac{(\xi^{-1})_{21}}{(\xi^{-1})_{11}}.$$
#
# The constant $d_{33}$ of data sheets is the charge per force under uniform stress; the stress below an indenter is not uniform.

# %%
stiffness = library_material("pzt-5h").stiffness
xi = axisymmetric_compliance(stiffness)
inverse = np.linalg.inv(xi[:2, :2])
charge_per_force = -inverse[1, 0] / inverse[0, 0]

for name, result in short.items():
    last = result.to_dataframe().iloc[-1]
    computed = last["charge"] / last["normal_force"]
    print(f"{name}: {1e12 * computed:.3f} pC/N")
    assert abs(computed / charge_per_force - 1) < 1e-4
print(f"closed form: {1e12 * charge_per_force:.3f} pC/N")

voigt = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
elastic = np.array([[stiffness[i, j, k, m] for k, m in voigt] for i, j in voigt])
piezoelectric = np.array([stiffness[i, j, 3, 2] for i, j in voigt])  # e_3ij
d33 = np.linalg.solve(elastic, piezoelectric)[2]
print(f"d33: {1e12 * d33:.0f} pC/N")
assert abs(charge_per_force) < d33

# %% [markdown]
# ## Voltage per force
#
# An open circuit divides this charge by the capacitance of the contact disc, which is proportional to its radius. Under a punch the
# radius is constant: the sensor is linear. Under a sphere the radius grows like $P^{1/3}$, and the voltage like $P^{2/3}$.

# %%
for name, result in floating.items():
    curve = result.to_dataframe()
    force, voltage = curve["normal_force"], abs(curve["electric_potential"])
    exponent = np.polyfit(np.log(force), np.log(voltage), 1)[0]
    print(
        f"{name}: V ~ P^{exponent:.3f}, {voltage.iloc[-1] / force.iloc[-1]:.2f} V/N"
    )
    assert abs(exponent - (1 if "punch" in name else 2 / 3)) < 5e-3

# %% [markdown]
# The voltage itself follows from the closed form, as the potential at which the charge vanishes at this force. Charge and force
# are linear in the potential under the punch:

# %%
earthed = indent(xi, FlatPunch(1e-3), 1e-6, electric_potential=0.0)
charged = indent(xi, FlatPunch(1e-3), 1e-6, electric_potential=-100.0)
potential = -100.0 * earthed.charge / (earthed.charge - charged.charge)
force = earthed.force + (charged.force - earthed.force) * potential / -100.0

curve = floating["flat punch, a = 1 mm"].to_dataframe()
computed = curve["electric_potential"].iloc[-1] / curve["normal_force"].iloc[-1]
print(
    f"punch: computed {computed:.4f} V/N, closed form {potential / force:.4f} V/N"
)
assert abs(computed / (potential / force) - 1) < 2e-3

# %% [markdown]
# ## Reciprocity
#
# At a given force, a voltage moves the punch. The energy of the body requires that displacement per voltage equals charge per
# force, so the sensor is also an actuator with the same constant.

# %%
case = meeframe.Case(
    title="Actuator",
    material="pzt-5h",
    mesh=meeframe.mesh.half_space("2.4 mm", divisions=40),
    formulation=meeframe.formulation("half-space", edges="resolved"),
    indenter=meeframe.FlatPunch("1 mm"),
    conductivity={"electric": meeframe.StepConductivity(np.inf)},
    steps=[
        meeframe.Step(normal_force="100 N"),
        meeframe.Step(electric_potential="50 V", increments=2),
    ],
)
driven = case.solve(progress=False).to_dataframe()
stroke = np.ptp(driven["approach"]) / 50.0
print(
    f"actuator: {1e12 * stroke:.3f} pm/V, sensor: {1e12 * abs(charge_per_force):.3f} pC/N"
)
assert abs(stroke / abs(charge_per_force) - 1) < 2e-3

# %% [markdown]
# ## A plate on a rigid base
#
# The thinner the plate, the more its base clamps it. A plate much thinner than the contact strains only along its
# thickness, and the charge per force tends to $e_{33}/c_{33}$. The grid is coarse, so these values are uncertain by a few per cent,
# as the comparison of two formulations shows.


# %%
def plate(thickness, formulation="dense-bem"):
    case = meeframe.Case(
        title=f"Plate of {thickness}",
        material="pzt-5h",
        mesh=meeframe.mesh.block(
            "10 mm", thickness, "4 mm", divisions=12, rings=3, layers=3
        ),
        boundary=[
            meeframe.Boundary(
                "base",
                displacement=[0, 0, 0],
                electric_potential=0,
                magnetic_potential=0,
            )
        ],
        indenter=meeframe.Sphere("1 m"),
        formulation=meeframe.formulation(formulation),
        conductivity={"electric": meeframe.StepConductivity(np.inf)},
        steps=[meeframe.Step(normal_force="300 N")],
    )
    last = case.solve(progress=False).to_dataframe().iloc[-1]
    return 1e12 * last["charge"] / last["normal_force"]


THICKNESS = ["20 mm", "4 mm", "1 mm", "0.5 mm"]
plates = pd.DataFrame(
    {"thickness": THICKNESS, "charge per force [pC/N]": map(plate, THICKNESS)}
)
plates.round(1)

# %%
sensitivity = abs(plates["charge per force [pC/N]"])
film = 1e12 * stiffness[2, 2, 3, 2] / stiffness[2, 2, 2, 2]
print(
    f"half space {abs(1e12 * charge_per_force):.0f} pC/N, e33/c33 = {film:.0f} pC/N"
)
assert sensitivity.is_monotonic_decreasing
assert sensitivity.iloc[0] < 1.08 * abs(1e12 * charge_per_force)
assert sensitivity.iloc[-1] > film

finite_elements = abs(plate("1 mm", "skfem"))
difference = finite_elements / sensitivity[2] - 1
print(f"1 mm: finite against boundary elements {difference:+.1%}")
assert abs(difference) < 0.05

# %% [markdown]
# ## Where to go next
#
# - [Conductivity laws](../reference/laws-conductivity.md) for electrodes with films or gaps
# - [A voltage sweep](../howto/tasks.md#a-voltage-sweep) under a tip
# - [Contact edges between the nodes](../explanation/halfspace.md#contact-edges-between-the-nodes), which made charges accurate here
# - [A piezoelectric film on silicon](film-on-substrate.py): the same sensor as a film
