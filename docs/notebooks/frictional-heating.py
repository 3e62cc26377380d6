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
# # Frictional heating of a slider
#
# A sphere slides on steel. Friction heats the surface, which bulges towards the sphere and concentrates the pressure. You learn
#
# - to give a material thermal constants, and to let friction heat the body,
# - how speed raises the pressure and limits the contact radius,
# - that the heat entering the body is the power of friction,
# - where a steady state ends.
#
# **Not covered:** heat carried by a moving surface at large Péclet numbers, and instability in time.

# %%
import matplotlib.pyplot as plt
import numpy as np

import meeframe
from meeframe.material import Material

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## The case
#
# `friction_heat = 1` sends all heat into the body; the sphere is an insulator. The speed is the translation of a step over its
# `duration`. The displacement of a half space is undetermined by a constant if heat flows, so a force is prescribed, not
# an approach.

# %%
YOUNG, POISSON, EXPANSION, CONDUCTIVITY = 200e9, 0.3, 12e-6, 40.0
RADIUS, FORCE, FRICTION = 0.1, 1000.0, 0.1
steel = Material.isotropic(YOUNG, POISSON, name="steel").with_heat(
    CONDUCTIVITY, EXPANSION
)


def slide(speed):
    """Return the last increment and its zone, for a speed [m/s]."""
    distance = 1e-3
    case = meeframe.Case(
        title="Slider",
        material=steel,
        mesh=meeframe.mesh.half_space("2.2 mm", divisions=40),
        formulation=meeframe.formulation("half-space"),
        contact=meeframe.Contact(
            meeframe.IsotropicCoulomb(FRICTION), friction_heat=1.0
        ),
        indenter=meeframe.Sphere(RADIUS),
        steps=[
            meeframe.Step(normal_force=FORCE),
            meeframe.Step(translation=(distance, 0.0), duration=distance / speed),
        ],
    )
    result = case.solve()
    assert result[-1].status == "converged"
    return result[-1], result.zone


# %% [markdown]
# ## Pressure and contact radius
#
# The strength of the feedback is $\lambda = \delta\mu VE^*a/2\pi$, with the distortivity $\delta = \alpha(1+\nu)/k$ of the surface
# and the contact radius $a$. No force makes the contact larger than the radius at which $\lambda$ is 0.6386.

# %%
MODULUS, DISTORTIVITY = (
    YOUNG / (1 - POISSON**2),
    EXPANSION * (1 + POISSON) / CONDUCTIVITY,
)
HERTZ_RADIUS = (3 * FORCE * RADIUS / (4 * MODULUS)) ** (1 / 3)
HERTZ_PRESSURE = 1.5 * FORCE / (np.pi * HERTZ_RADIUS**2)
speeds = np.array([0.02, 0.05, 0.1, 0.2, 0.4])
radii, pressures, heats = [], [], []
for speed in speeds:
    last, zone = slide(speed)
    radii.append(np.sqrt(zone.weights @ last.touching / np.pi))
    pressures.append(-last.traction[:, 2].min())
    heats.append(zone.weights @ last.fluxes[:, 2])
radii, pressures, heats = np.array(radii), np.array(pressures), np.array(heats)
limits = 2 * np.pi * 0.6386 / (DISTORTIVITY * FRICTION * speeds * MODULUS)

fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
left.plot(speeds, radii * 1e3, "o-", label="computed")
left.plot(
    speeds, np.minimum(limits, 3 * HERTZ_RADIUS) * 1e3, "--", label="upper limit"
)
left.axhline(HERTZ_RADIUS * 1e3, color="grey", label="Hertz")
left.set(xlabel="speed [m/s]", ylabel="contact radius [mm]", xscale="log")
left.legend()
right.plot(speeds, pressures / 1e6, "o-")
right.axhline(HERTZ_PRESSURE / 1e6, color="grey")
right.set(xlabel="speed [m/s]", ylabel="largest pressure [MPa]", xscale="log")
for axes in (left, right):
    axes.minorticks_off()
    axes.set_xticks(speeds, [f"{speed:g}" for speed in speeds])

# %% [markdown]
# The contact shrinks with speed and stays below its limit, and all power of friction enters the body.

# %%
assert (np.diff(pressures) > 0).all()
assert (np.diff(radii) <= 0).all()
assert (radii < limits).all()
assert np.allclose(-heats, FRICTION * FORCE * speeds, rtol=0.02)
strength = DISTORTIVITY * FRICTION * speeds * MODULUS * radii / (2 * np.pi)
print(np.round(strength, 3))

# %% [markdown]
# A message of the result also states $\lambda$.

# %%
print(last.message)
assert "frictional heat: lambda" in last.message

# %% [markdown]
# ## Where to go next
#
# - [Heat](../explanation/heat.md): equations, signs, and which solutions exist
# - [Thermal constants of materials](../reference/materials.md#heat)
# - [Rough contact](rough-contact.py): conductance of rough surfaces
