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
# # A piezoelectric film on silicon
#
# A conducting sphere presses on a PZT-5H film, whose bottom electrode is grounded, on silicon. You learn
#
# - to describe a film with an electrode on a substrate,
# - how charge and voltage of this sensor depend on the thickness of the film,
# - which modulus an indentation test measures, and when the substrate distorts it,
# - which piezoelectric constant an indentation test measures, and why it is not $d_{33}$,
# - where the interface is sheared most.
#
# **Not covered:** domain switching, residual stress, and plasticity.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from meeframe_halfspace import indentation_modulus

import meeframe
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance, surface_compliance

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## The case
#
# A layer has a material, a thickness and the interface below it; the electrode is part of the interface. One run contains four states
# at a given force or close to it: short circuit, a small voltage, open circuit, and short circuit again at a slightly larger force.

# %%
RADIUS, FORCE, VOLTAGE = 10e-6, 2e-3, 0.1


def press(thickness):
    """Return the result for a film of some thickness [m]; None for bulk PZT."""
    film = meeframe.Layer(
        "pzt-5h",
        thickness or 1.0,
        interface=meeframe.Interface(electrode="grounded"),
    )
    case = meeframe.Case(
        title="Film on silicon",
        material="silicon" if thickness else "pzt-5h",
        layers=[film] if thickness else [],
        mesh=meeframe.mesh.half_space("1.6 um", divisions=40),
        formulation=meeframe.formulation("half-space"),
        indenter=meeframe.Sphere(RADIUS),
        conductivity={"electric": meeframe.StepConductivity(np.inf)},
        steps=[
            meeframe.Step(normal_force=FORCE),
            meeframe.Step(electric_potential=VOLTAGE),
            meeframe.Step(charge=0),
            meeframe.Step(normal_force=1.001 * FORCE, electric_potential=0),
        ],
    )
    result = case.solve(progress=False)
    assert result.status == "converged"
    return result


MICROMETRES = [0.05, 0.1, 0.2, 0.5, 1.0, 2.5, 8.0]
THICKNESS = 1e-6 * np.array(MICROMETRES)
films = [press(float(thickness)) for thickness in THICKNESS]
bulk = press(None)


# %%
def measures(result):
    """Return what a sensor and an indentation test measure."""
    short, driven, floating, more = (
        row for _, row in result.to_dataframe().iterrows()
    )
    approach = short["approach"]
    return {
        "a [um]": 1e6 * np.sqrt(short["contact_area"] / np.pi),
        "charge per force [pC/N]": -1e12 * short["charge"] / FORCE,
        "voltage per force [kV/N]": -1e-3 * floating["electric_potential"] / FORCE,
        "modulus [GPa]": 0.75e-9 * FORCE / np.sqrt(RADIUS) / approach**1.5,
        "stroke [pm/V]": 1e12 * (driven["approach"] - approach) / VOLTAGE,
        "slope of the charge [pC/N]": -1e12
        * (more["charge"] - short["charge"])
        / (0.001 * FORCE),
    }


table = pd.DataFrame([measures(result) for result in [*films, bulk]])
table.index = pd.Index([*MICROMETRES, np.inf], name="h [um]")
table.round(2)

# %% [markdown]
# With cells of half the size, these numbers change by less than 0.3 %.
#
# ## Charge and voltage
#
# A thick film behaves like a half space, whose charge per force follows from a closed form
# ([a force sensor](force-sensor.py)). A thin film on the stiff substrate cannot contract sideways and yields less charge. It yields much
# less voltage, because its capacitance grows as it becomes thinner: the voltage is proportional to the thickness.

# %%
pzt = library_material("pzt-5h")
inverse = np.linalg.inv(axisymmetric_compliance(pzt.stiffness)[:2, :2])
half_space = 1e12 * abs(inverse[1, 0] / inverse[0, 0])

charge, voltage = (
    table["charge per force [pC/N]"],
    table["voltage per force [kV/N]"],
)
assert abs(charge[np.inf] / half_space - 1) < 1e-4
assert charge.is_monotonic_increasing
assert voltage.is_monotonic_increasing
assert abs(charge[8.0] / half_space - 1) < 0.02
exponent = np.log(voltage[0.1] / voltage[0.05]) / np.log(2.0)
print(f"thin films: V ~ h^{exponent:.2f}")
assert abs(exponent - 1.0) < 0.03

ratio = THICKNESS / (1e-6 * table["a [um]"].to_numpy()[:-1])
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.semilogx(ratio, charge[:-1], "o-")
left.axhline(
    half_space, color="0.5", linestyle=":", label="half space, closed form"
)
left.set(
    xlabel="h / a [-]", ylabel="charge per force [pC/N]", title="short circuit"
)
left.legend()
right.loglog(ratio, voltage[:-1], "o-")
right.axhline(voltage[np.inf], color="0.5", linestyle=":")
right.set(
    xlabel="h / a [-]", ylabel="voltage per force [kV/N]", title="open circuit"
)

# %% [markdown]
# ## The measured modulus
#
# Hertz's law turns force and approach into an indentation modulus, $M = 3P/4\sqrt{R\delta^3}$. It lies between that of silicon and
# that of PZT. The most common approximation, by Gao, Chiu and Lee (1992), weights the two compliances by a function of $h/a$. It is exact for
# small differences between isotropic bodies under a punch. Here the moduli differ by a factor of two, and the indenter is a sphere.


# %%
def weight(xi, nu=0.3):
    """Return the share of the film in the compliance, from Gao, Chiu and Lee (1992)."""
    logarithm = np.log((1.0 + xi**2) / xi**2)
    return 2.0 / np.pi * np.arctan(xi) + (
        (1.0 - 2.0 * nu) * xi * logarithm - xi / (1.0 + xi**2)
    ) / (2.0 * np.pi * (1.0 - nu))


modulus = table["modulus [GPa]"]
silicon = 1e-9 * indentation_modulus(library_material("silicon").stiffness)
approximation = 1.0 / (
    weight(ratio) / modulus[np.inf] + (1.0 - weight(ratio)) / silicon
)
figure, axes = plt.subplots(figsize=(5.5, 3.6), layout="constrained")
axes.semilogx(ratio, modulus[:-1], "o-", label="computed")
axes.semilogx(ratio, approximation, "--", label="Gao, Chiu and Lee")
axes.axhline(silicon, color="0.5", linestyle=":")
axes.text(ratio[-1], silicon, "silicon", ha="right", va="bottom", color="0.3")
axes.axhline(modulus[np.inf], color="0.5", linestyle=":")
axes.text(ratio[0], modulus[np.inf], "PZT-5H, grounded", va="bottom", color="0.3")
axes.set(xlabel="h / a [-]", ylabel="M [GPa]", title="modulus from Hertz's law")
axes.legend(loc="center left")

assert modulus.is_monotonic_decreasing
assert modulus[np.inf] < modulus[8.0] < modulus[0.05] < silicon
print(
    f"largest error of the approximation: {abs(approximation / modulus[:-1] - 1).max():.0%}"
)

# %% [markdown]
# A common rule takes the modulus of a film from indentations below a tenth of its thickness. It holds for sharp tips, whose contact is
# as narrow as the indentation is deep. Under a sphere, the contact is much wider than deep: what matters is $h/a$.

# %%
indentation = np.array([result[0].loading.approach for result in films])
error = modulus[:-1] / modulus[np.inf] - 1.0
at_a_tenth = np.interp(0.1, (indentation / THICKNESS)[::-1], error[::-1])
print(f"error of the modulus at the indentation h / 10: {at_a_tenth:+.0%}")
assert at_a_tenth > 0.5
pd.DataFrame(
    {"indentation / h": (indentation / THICKNESS).round(3), "error": error.round(3)}
)

# %% [markdown]
# ## The measured piezoelectric constant
#
# Two experiments measure the constant: the charge per force, and the stroke per voltage at a constant force. On a half space both are the same
# number. On a film they differ, because its charge is not proportional to the force. By reciprocity, the stroke equals the
# *slope* of the charge. Neither is $d_{33}$, the strain of a free plate per field, because the film around the contact resists.
#
# In a film much thinner than the contact, the field is uniform below it, and the film expands by $e_{33}/c_{33}$ per voltage. It also
# tends to change its width, with the force $\bar e_{31} = e_{31} - e_{33}c_{13}/c_{33}$ per voltage and length of the contact edge. Such a ring of
# forces lowers the surface of the substrate within it by $|Y_{13}\,\bar e_{31}|$ per voltage, where $Y_{13}$ is the response of the
# normal displacement to tangential loads. It does not depend on the thickness, and subtracts from the stroke.

# %%
stroke, slope = table["stroke [pm/V]"], table["slope of the charge [pC/N]"]
voigt = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
stiffness = pzt.stiffness
elastic = np.array([[stiffness[i, j, k, m] for k, m in voigt] for i, j in voigt])
piezoelectric = np.array([stiffness[i, j, 3, 2] for i, j in voigt])
d33 = 1e12 * np.linalg.solve(elastic, piezoelectric)[2]
clamped = 1e12 * piezoelectric[2] / elastic[2, 2]
sideways = piezoelectric[0] - piezoelectric[2] * elastic[0, 2] / elastic[2, 2]
angles = np.linspace(0.0, np.pi, 16, endpoint=False)
waves = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
surface = surface_compliance(
    library_material("silicon").stiffness, (0, 0, 1), waves
)
coupling = abs(np.einsum("pi,pi->p", surface[:, 2, :3], waves)).mean()
thinnest = clamped - 1e12 * coupling * abs(sideways)

figure, axes = plt.subplots(figsize=(5.5, 3.6), layout="constrained")
axes.semilogx(ratio, stroke[:-1], "o-", label="stroke per voltage")
axes.semilogx(ratio, slope[:-1], "x", label="slope of the charge")
axes.semilogx(ratio, charge[:-1], "s--", label="charge per force")
levels = {
    "$d_{33}$": d33,
    "$e_{33}/c_{33}$": clamped,
    "limit of thin films": thinnest,
}
for name, level in levels.items():
    axes.axhline(level, color="0.5", linestyle=":")
    axes.text(
        ratio[-1],
        level,
        name,
        ha="right",
        va="bottom",
        color="0.3",
        fontsize="small",
    )
axes.set(xlabel="h / a [-]", ylabel="piezoelectric constant [pm/V]")
axes.legend()

print(
    f"d33 = {d33:.0f}, bulk {stroke[np.inf]:.0f}, thinnest film {stroke[0.05]:.0f}, limit {thinnest:.0f} pm/V"
)
assert (abs(slope / stroke - 1) < 0.02).all()
assert (stroke < d33).all()
assert thinnest < stroke[0.05] < clamped < stroke[np.inf]

# %% [markdown]
# ## The interface
#
# `meeframe.interfaces` returns the largest tension and shear on each interface. The shear is largest beside the contact edge for
# thin films and decreases with the depth of the interface.

# %%
rows = []
for thickness, result in list(zip(THICKNESS, films, strict=True))[2:5]:
    (interface,) = meeframe.interfaces(result, step=1)
    rows.append(
        {
            "h [um]": 1e6 * thickness,
            "shear [MPa]": 1e-6 * interface.shear.value,
            "distance from the axis / a": np.hypot(*interface.shear.position[:2])
            / np.sqrt(
                meeframe.resultants(result.zone, result[0]).contact_area / np.pi
            ),
        }
    )
shear = pd.DataFrame(rows).set_index("h [um]")
assert shear["shear [MPa]"].is_monotonic_decreasing
assert 0.7 < shear["distance from the axis / a"].iloc[0] < 1.3
shear.round(2)

# %% [markdown]
# ## Where to go next
#
# - [Films and coatings](../howto/films.md): thickness of cells, interfaces, graded films, coated bodies in contact
# - [Layers](../explanation/layers.md): how the response is computed, and its accuracy
# - [A piezoelectric force sensor](force-sensor.py): the same on bulk material
