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
# # Hysteresis and dissipation
#
# Slip with friction dissipates energy. Two loops show this: a tangential force that swings back and forth, and a normal load that is
# applied and removed. You learn
#
# - to prescribe a cyclic load,
# - to draw loops and the traction after a reversal,
# - to compare with the theory of Cattaneo and Mindlin,
# - to check the energy balance, and how many increments it needs.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import meeframe
from meeframe.testing.closed_forms_friction import HertzContact, PartialSlip

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## A tangential loop
#
# A sphere is pressed against an incompressible half space with a constant force. A tangential force then swings between $\pm 0.7 \mu P$. The
# outside of the contact slips at once; the inside sticks.

# %%
YOUNG, POISSON, RADIUS, MU = 210e9, 0.4999, 0.1, 0.4
hertz = HertzContact(YOUNG, POISSON, RADIUS, approach=4e-6)
mindlin = PartialSlip(hertz, MU)
FORCE = 0.7 * mindlin.limit_force


def swing(increments):
    """Solve a full loop, with this number of increments from one end to the other."""
    return meeframe.Case(
        title="Tangential loop",
        material={
            "name": "isotropic",
            "young_modulus": YOUNG,
            "poisson_ratio": POISSON,
        },
        mesh=meeframe.mesh.half_space("1.6 mm", divisions=24),
        formulation=meeframe.formulation("half-space"),
        indenter=meeframe.Sphere(RADIUS),
        contact=meeframe.IsotropicCoulomb(MU),
        steps=[
            meeframe.Step(normal_force=hertz.force),
            meeframe.Step(tangential_force=[FORCE, 0], increments=increments // 2),
            meeframe.Step(tangential_force=[-FORCE, 0], increments=increments),
            meeframe.Step(tangential_force=[FORCE, 0], increments=increments),
        ],
    ).solve(progress=False)


def loop_of(result):
    """Return the closed loop: from the end of the first loading back to it."""
    curve = result.to_dataframe()
    start = curve.index[curve["step"] == 2][-1]
    return curve.loc[start:]


loops = {increments: swing(increments) for increments in (8, 16, 32)}
curve, loop = loops[16].to_dataframe(), loop_of(loops[16])

# %% [markdown]
# Mindlin's theory gives force and displacement in closed form, first for loading, and from it for each reversal.

# %%
peak = mindlin.displacement(FORCE)
back = np.linspace(-peak, peak, 200)
down = np.array([mindlin.force_after_reversal(d, peak) for d in back])

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
left.plot(1e6 * back, down, "k-", lw=1, label="Mindlin")
left.plot(-1e6 * back, -down, "k-", lw=1)
displacement, force = 1e6 * curve["translation_1"], curve["tangential_force_1"]
left.plot(displacement, force, "o", ms=4, label="meeframe")
left.set(xlabel="tangential displacement [µm]", ylabel="tangential force [N]")
left.legend()

x = np.linspace(-0.8e-3, 0.8e-3, 400)
traction = loops[16].to_xarray()["traction_x"].sel(y=0, method="nearest")
states = {
    "at the peak": (8, mindlin.traction(abs(x), FORCE)),
    "force removed": (
        16,
        mindlin.traction_after_reversal(abs(x), np.interp(0, down, back), peak),
    ),
    "opposite peak": (24, mindlin.traction_after_reversal(abs(x), -peak, peak)),
}
for name, (increment, exact) in states.items():
    right.plot(1e3 * x, 1e-6 * exact, "k-", lw=1)
    section = traction.isel(increment=increment)
    right.plot(1e3 * section.x, 1e-6 * section, "o", ms=4, label=name)
right.set(xlabel="x [mm]", ylabel="tangential traction [MPa]")
right.legend(fontsize="small")

# %%
backward = loop[loop["step"] == 3]
exact = np.interp(backward["translation_1"], back, down)
deviation = abs(backward["tangential_force_1"] - exact).max() / FORCE
closing = abs(loop["translation_1"].iloc[-1] / loop["translation_1"].iloc[0] - 1)
print(f"largest deviation of the force from Mindlin: {deviation:.1%} of its peak")
print(f"the loop closes to {closing:.1e} of its peak displacement")
assert deviation < 0.03
assert closing < 0.01

# %% [markdown]
# When the force is removed, tractions of both signs remain locked in. The stick zone at the peak:

# %%
loops[16].plot.stick_slip(step=2)

# %%
stick = np.sqrt(curve.loc[curve["step"] == 2, "stick_area"].iloc[-1] / np.pi)
exact_stick = mindlin.stick_radius(FORCE)
print(f"stick radius {1e3 * stick:.3f} mm, closed form {1e3 * exact_stick:.3f} mm")
assert abs(stick / exact_stick - 1) < 0.05

# %% [markdown]
# ## Energy balance of the loop
#
# After a full loop, the elastic energy is the same as before. The work of the indenter, $\oint T\, d\delta + \oint P\, dg$, must then equal the
# energy that friction dissipates, which the result sums up from traction and slip at each node. Their difference is an error of
# the increments, and falls with the square of their number.

# %%
rows = []
for increments, result in loops.items():
    turn = loop_of(result)
    work = np.trapezoid(turn["tangential_force_1"], turn["translation_1"])
    work += np.trapezoid(turn["normal_force"], turn["approach"])
    dissipated = turn["dissipated_energy"].iloc[1:].sum()
    rows.append((increments, 1e6 * work, 1e6 * dissipated, work / dissipated - 1))
columns = ["increments", "work [µJ]", "dissipated [µJ]", "difference"]
energy = pd.DataFrame(rows, columns=columns)
energy.round(5)

# %%
logarithms = np.log(energy["increments"]), np.log(abs(energy["difference"]))
order = -np.polyfit(*logarithms, 1)[0]
print(f"order of the energy balance: {order:.1f}")
assert order > 1.8
assert abs(energy["difference"].iloc[-1]) < 2e-3

exact = 1e6 * mindlin.loop_dissipation(FORCE)
deviation = energy["dissipated [µJ]"].iloc[-1] / exact - 1
print(f"dissipated energy against Mindlin: {deviation:+.1%}")
assert abs(deviation) < 0.02

# %% [markdown]
# Mindlin's solution neglects the slip across the force, so the two need not agree exactly.
#
# ## A normal loop
#
# A compressible body moves tangentially under pressure. With friction, the surfaces slip while the contact grows and again while it
# shrinks, so even a purely normal load dissipates.

# %%
case = meeframe.Case(
    title="Normal loop",
    material={"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": 0.0},
    mesh=meeframe.mesh.half_space("1.6 mm", divisions=24),
    formulation=meeframe.formulation("half-space"),
    indenter=meeframe.Sphere(RADIUS),
    contact=meeframe.IsotropicCoulomb(0.1),
    steps=[
        meeframe.Step(approach="4 um", increments=20),
        meeframe.Step(approach=0, increments=20),
    ],
)
normal = case.solve(progress=False).to_dataframe()
approach = np.concatenate([[0.0], normal["approach"]])
force = np.concatenate([[0.0], normal["normal_force"]])
loading, unloading = slice(0, 21), slice(20, 41)

work = np.trapezoid(force, approach)
stored = np.trapezoid(force[loading], approach[loading])
dissipated = normal["dissipated_energy"].sum()
print(f"work of the loop {1e6 * work:.2f} µJ, dissipated {1e6 * dissipated:.2f} µJ")
print(f"that is {dissipated / stored:.1%} of the work of loading")
assert abs(work / dissipated - 1) < 0.02
assert 0 < dissipated < 0.05 * stored

# %% [markdown]
# The loop is too thin to be seen in the force itself. Its width, and the energy:

# %%
energy = 1e6 * np.concatenate([[0.0], normal["dissipated_energy"].cumsum()])
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.plot(1e6 * approach[loading], force[loading] - force[unloading][::-1], "o-")
left.set(xlabel="approach [µm]", ylabel="force of loading minus unloading [N]")
right.plot(1e6 * approach[loading], energy[loading], "o-", label="loading")
right.plot(1e6 * approach[unloading], energy[unloading], "s--", label="unloading")
right.set(xlabel="approach [µm]", ylabel="dissipated energy so far [µJ]")
right.legend()

# %% [markdown]
# ## Where to go next
#
# - [Dissipated energy](../reference/results.md#dissipated-energy) in results
# - [Load steps](../reference/case-files.md#load-steps): forces, motions, increments
# - [Exact friction](../validation/exact_friction.md): more closed forms with friction, and their errors
# - [Write a friction law](friction-law.py) and see its loop
