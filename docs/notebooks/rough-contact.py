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
# # Rough contact, from a height map to area, stiffness and potential
#
# A rough surface touches in many small spots. You learn
#
# - to make a self-affine surface, or use your own height map, as the indenter,
# - to compute the contact area, the stiffness and the electrical conductance against the load,
# - two laws to check such results with: area proportional to load, and conductance proportional to stiffness,
# - to compute the potential of a piezoelectric body under a rough surface.

# %%
import matplotlib.pyplot as plt
import numpy as np

import meeframe

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## A height map
#
# Any array of heights on a regular grid will do: rows along y, columns along x. Here we filter white noise so that its spectrum
# is self-affine between two wavelengths, with a Hurst exponent of 0.8. The surface is periodic. The indenter `self-affine` makes such
# surfaces without this cell.

# %%
N, PERIOD, RMS, HURST = 128, 1e-3, 1e-6, 0.8
LONGEST, SHORTEST = PERIOD / 2, PERIOD / 16

waves = np.fft.fftfreq(N, PERIOD / N)
k = np.hypot(waves[:, None], waves[None, :])  # waves per metre
spectrum = np.zeros_like(k)
band = (k >= 1 / LONGEST) & (k <= 1 / SHORTEST)
spectrum[band] = k[band] ** -(1 + HURST)
noise = np.fft.fft2(np.random.default_rng(7).standard_normal((N, N)))
heights = np.fft.ifft2(noise * spectrum).real
heights *= RMS / heights.std()
np.save("surface.npy", heights)

transform = np.fft.fft2(heights)
rms_slope = np.sqrt((abs(2 * np.pi * k * transform) ** 2).sum()) / N**2
print(f"rms slope {rms_slope:.4f}")

figure, axes = plt.subplots(figsize=(5, 4), layout="constrained")
extent = [0, 1e3 * PERIOD, 0, 1e3 * PERIOD]
image = axes.imshow(1e6 * heights, origin="lower", extent=extent)
figure.colorbar(image, label="height [µm]")
axes.set(xlabel="x [mm]", ylabel="y [mm]")
axes.grid(False)

# %% [markdown]
# ## The case
#
# Copper, periodic like the surface: N nodes make a period, so the zone is one spacing narrower. Steady current obeys the equations of
# electrostatics, so the [conductivity stands in for the permittivity](../howto/contact-resistance.md), and the charge is the current
# at a potential difference of 1 V. `density="constant"` uses cells, which
# [suit the smooth edges of rough contact](../explanation/halfspace.md#how-it-works).

# %%
YOUNG, POISSON, CONDUCTIVITY = 120e9, 0.34, 5.8e7
MODULUS = YOUNG / (1 - POISSON**2)
COPPER = {
    "name": "isotropic",
    "young_modulus": YOUNG,
    "poisson_ratio": POISSON,
    "permittivity": CONDUCTIVITY,
}
CONDUCTING = {"electric": meeframe.StepConductivity(np.inf)}
pressure = np.linspace(0.005, 0.1, 12)  # mean, relative to E* times the rms slope
load = pressure * MODULUS * rms_slope * PERIOD**2


def press(material, forces, conductivity, potential=0.0):
    return meeframe.Case(
        title="Rough contact",
        material=material,
        mesh=meeframe.mesh.half_space(PERIOD * (N - 1) / N, divisions=N - 1),
        formulation=meeframe.formulation(
            "half-space", periodic=True, density="constant"
        ),
        indenter=meeframe.indenter(
            "height-map", file="surface.npy", spacing=[PERIOD / N, PERIOD / N]
        ),
        conductivity=conductivity,
        potentials={"electric_potential": potential},
        steps=[meeframe.Step(normal_force=force) for force in forces],
    ).solve()


result = press(COPPER, load, CONDUCTING, potential=1.0)
curve = result.to_dataframe()

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
result.plot.pressure(left, step=4)
result.plot.pressure(right, step="last")

# %% [markdown]
# ## Area
#
# The contact area of a rough surface is proportional to the load at first,
#
# $$\frac{A}{A_0} = \kappa\, \frac{\bar p}{E^* h'_{rms}}, \qquad \kappa = \sqrt{2\pi} \text{ to } \sqrt{8/\pi}$$
#
# from the limits of the theories of Bush, Gibson and Thomas, and of Persson. Simulations lie in between. The area is counted in nodes,
# so it depends on the shortest wavelength and on the grid: a number without both says little.

# %%
area = curve["contact_area"] / PERIOD**2
kappa = (area / pressure).iloc[1:5]
upper, lower = np.sqrt(2 * np.pi), np.sqrt(8 / np.pi)
print(
    f"kappa from {kappa.min():.2f} to {kappa.max():.2f}; theories {lower:.2f}, {upper:.2f}"
)
assert (kappa > lower).all()
assert (kappa < upper).all()

# %% [markdown]
# ## Stiffness and conductance
#
# The conductance $G$ of the contact and its incremental stiffness $dP/dg$ are one and the same function of the spots
# (Barber, *Proc. R. Soc. A* 459 (2003) 53-66):
#
# $$G = \frac{2 \sigma}{E^*} \frac{dP}{dg}.$$
#
# One side is computed from the current, the other one from differences of forces and approaches, so the identity checks
# both. The first interval is too long for a difference quotient, because the stiffness doubles in it.

# %%
force, approach = curve["normal_force"].to_numpy(), curve["approach"].to_numpy()
stiffness = np.diff(force) / np.diff(approach)
conductance = -curve["charge"].to_numpy()  # current into the body at 1 V
between = (conductance[1:] + conductance[:-1]) / 2
ratio = between / (2 * CONDUCTIVITY / MODULUS * stiffness)
print(
    f"conductance over its value from the stiffness: {ratio[1:].min():.3f} to {ratio[1:].max():.3f}"
)
assert abs(ratio[1:] - 1).max() < 0.03

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
left.plot(pressure, area, "o-", label="meeframe")
left.plot(pressure, upper * pressure, "--", label="Bush, Gibson, Thomas")
left.plot(pressure, lower * pressure, ":", label="Persson")
left.set(
    xlabel="mean pressure / (E* rms slope) [1]",
    ylabel="contact area / nominal area [1]",
)
left.legend()
right.plot(force, 1e-3 * conductance, "o-", label="from the current")
middle = (force[1:] + force[:-1]) / 2
from_stiffness = 2 * CONDUCTIVITY / MODULUS * stiffness
right.plot(middle, 1e-3 * from_stiffness, "x", label="from the stiffness")
right.set(xlabel="normal force [N]", ylabel="conductance [kS]")
right.legend()

# %% [markdown]
# ## Potential of a piezoelectric body
#
# The same surface on PZT-4, first as an insulator. The pressure on the spots charges the surface.

# %%
insulating = press("pzt-4", load[:6], conductivity={})

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
insulating.plot.map("electric_potential", left, step="last")
insulating.plot.pressure(right, step="last")

# %% [markdown]
# The potential has the shape of the normal displacement. Both are caused by the same pressure, and the response $\xi$ of the
# material to a point source gives their ratio:

# %%
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance

xi = axisymmetric_compliance(library_material("pzt-4").stiffness)
last = insulating.to_xarray().isel(increment=-1)
potential = last["electric_potential"]
expected = xi[1, 0] / xi[0, 0] * last["displacement"].sel(component="nu")
difference = float(abs(potential - expected).max() / abs(potential).max())
print(f"largest potential {float(abs(potential).max()):.0f} V")
print(f"largest difference from the scaled displacement {difference:.1e}")
assert difference < 1e-6

# %% [markdown]
# As an earthed conductor, the surface draws a charge that is proportional to the force, with the constant of the
# [force sensor](force-sensor.py), for any roughness. The charges of the spots then cancel the potential everywhere, even between the
# spots:

# %%
earthed = press("pzt-4", load[:6], conductivity=CONDUCTING)
inverse = np.linalg.inv(xi[:2, :2])
constant = -inverse[1, 0] / inverse[0, 0]
totals = earthed.to_dataframe()
ratio = totals["charge"] / totals["normal_force"]
print(f"charge per force {1e12 * ratio.min():.3f} to {1e12 * ratio.max():.3f} pC/N")
print(f"closed form {1e12 * constant:.3f} pC/N")
assert abs(ratio / constant - 1).max() < 1e-6

remaining = float(abs(earthed.to_xarray()["electric_potential"]).max())
print(f"largest potential {remaining:.1e} V")
assert remaining < 1e-6 * float(abs(potential).max())

# %% [markdown]
# ## Where to go next
#
# - [Rough surfaces](../explanation/halfspace.md#rough-surfaces): files of profilometers, the indenter `self-affine`
# - [Contact resistance](../howto/contact-resistance.md) of smooth and rough contacts, with films
# - [Two rough bodies](../howto/tasks.md#two-rough-bodies)
