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
# # Wear of a coated film
#
# A sphere slides on steel with a hard film of 10 µm. Archard's law wears the film off, the pressure falls, and the scar grows. You learn
#
# - to let a contact wear over a sliding distance, with increments that divide themselves,
# - how the pressure runs in, on the film and on bare steel,
# - which properties of the scar and of the life of the film depend on the film, and which only on geometry.
#
# **Not covered:** films that become compliant as they get thin. The elastic body keeps its thickness, so depths should stay well below that
# of the film.

# %%
import matplotlib.pyplot as plt
import numpy as np

import meeframe

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## The case
#
# Nothing wears while the sphere is pressed against the film: `sliding=0`. In each of the other steps it slides a distance; the step is
# divided so that the pressure changes by at most 15 % in each subincrement. `wear` is the depth that both surfaces lose; here it belongs to the film, which stays
# under the contact, as in a test with a reciprocating ball of a much harder material.

# %%
FORCE, RADIUS, THICKNESS, COEFFICIENT = 2.0, 5e-3, 10e-6, 2e-14
SLIPS = np.array([0.0, 0.005, 0.02, 0.08, 0.2, 0.4])
steel = {"name": "isotropic", "young_modulus": "200 GPa", "poisson_ratio": 0.3}
hard = {"name": "isotropic", "young_modulus": "400 GPa", "poisson_ratio": 0.2}


def slide(*layers):
    """Return the result for layers on steel."""
    sliding = [
        meeframe.Step(sliding=distance, max_pressure_change=0.15)
        for distance in np.diff(SLIPS)
    ]
    case = meeframe.Case(
        material=steel,
        layers=layers,
        mesh=meeframe.mesh.half_space("240 um", divisions=27),
        formulation=meeframe.formulation("half-space"),
        contact=meeframe.Contact(wear=meeframe.Archard(COEFFICIENT)),
        indenter=meeframe.Sphere(RADIUS),
        steps=[meeframe.Step(normal_force=FORCE, sliding=0), *sliding],
    )
    result = case.solve()
    assert result.status == "converged"
    return result


results = {
    "film": slide(meeframe.Layer(hard, THICKNESS)),
    "bare steel": slide(),
}

# %% [markdown]
# ## Running-in of the pressure
#
# The stiff film raises the pressure on the new surface. Wear removes this effect: the pressure becomes uniform over the scar.

# %%
fig, axes = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True)
for panel, (name, result) in zip(axes, results.items(), strict=True):
    points = result.zone.points
    line = np.flatnonzero(np.abs(points[:, 1] - np.abs(points[:, 1]).min()) < 1e-9)
    line = line[np.argsort(points[line, 0])]
    for step, slip in zip(result, SLIPS, strict=True):
        pressure = -step.traction[line, 2]
        panel.plot(points[line, 0] * 1e6, pressure / 1e9, ".-", label=f"{slip:g} m")
    panel.set(title=name, xlabel="x [µm]")
axes[0].set(ylabel="pressure [GPa]")
axes[1].legend()

peaks = {
    name: [-step.traction[:, 2].min() for step in result]
    for name, result in results.items()
}
assert peaks["film"][0] > 1.05 * peaks["bare steel"][0]
assert np.isclose(peaks["film"][-1], peaks["bare steel"][-1], rtol=0.03)

# %% [markdown]
# ## Volume and scar
#
# The worn volume is $kPs$ whatever the pressure, so the film does not matter. A deep scar has the radius $a$ with $a^4 = 4kPRs/\pi$, and the depth
# $a^2/2R$.

# %%
for result in results.values():
    totals = [meeframe.resultants(result.zone, step) for step in result]
    volumes = [total.worn_volume for total in totals]
    assert np.allclose(volumes, COEFFICIENT * FORCE * SLIPS, rtol=1e-8)
    depths = np.array([step.wear.max() for step in result])
    scar = (4 * COEFFICIENT * FORCE * RADIUS * SLIPS / np.pi) ** 0.25
    print(np.round(depths * 1e6, 3), np.round(scar**2 / (2 * RADIUS) * 1e6, 3))
    assert np.isclose(depths[-1], scar[-1] ** 2 / (2 * RADIUS), rtol=0.1)

# %% [markdown]
# ## Life of the film
#
# Geometry gives the distance after which the scar is as deep as the film, $s = \pi R h^2/(kP)$: four times as long for twice the thickness.

# %%
print(f"{np.pi * RADIUS * THICKNESS**2 / (COEFFICIENT * FORCE):.2f} m")

# %% [markdown]
# ## Where to go next
#
# - [Wear](../explanation/wear.md): signs, increments, accuracy
# - [Running-in and fretting](../howto/wear.md)
# - [Layers](../explanation/layers.md)
