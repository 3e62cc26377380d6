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
# # Rolling: creep curves, spin and a signal
#
# A wheel that drives or brakes creeps: it turns a little faster or slower than in free rolling, and the tangential force grows with
# the creepage up to the limit of friction. You learn
#
# - to compute a creep curve from steady states,
# - to follow the transition from rest to rolling cell by cell,
# - to see what spin does,
# - to record the charge on an electrode that rolls over a piezoelectric body.
#
# Signs and the scheme are on the page [Rolling](../explanation/rolling.md).

# %%
import matplotlib.pyplot as plt
import numpy as np

import meeframe

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## A creep curve
#
# A rigid ball rolls on an incompressible body, for which pressure and friction do not affect each other. Each step directly finds the
# steady state at a larger creepage.

# %%
YOUNG, POISSON, RADIUS, FRICTION, FORCE = 3e6, 0.4999, 20e-3, 0.5, 2.0
RUBBER = {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": POISSON}
WIDTH, DIVISIONS = 8e-3, 32


def ball(steps, material=RUBBER, force=FORCE, width=WIDTH, **arguments):
    """Solve the case of a ball on a half space."""
    case = meeframe.Case(
        title="Rolling ball",
        material=material,
        mesh=meeframe.mesh.half_space(width, DIVISIONS),
        formulation=meeframe.formulation("half-space"),
        indenter=meeframe.Sphere(RADIUS),
        contact=meeframe.IsotropicCoulomb(FRICTION),
        steps=[meeframe.Step(normal_force=force), *steps],
        **arguments,
    )
    result = case.solve(progress=False)
    assert result.status == "converged"
    return result


def steady(creepage=(0.0, 0.0), spin=0.0):
    """Return a step of steady rolling along x."""
    return meeframe.Step(
        rolling={"steady": True, "creepage": list(creepage), "spin": spin}
    )


creepages = np.array([1e-4, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.12, 0.16])
curve = (
    ball([steady((creepage, 0.0)) for creepage in creepages])
    .to_dataframe()
    .iloc[1:]
)
ratio = curve["creep_force_longitudinal"].to_numpy() / (FRICTION * FORCE)
curve[
    [
        "creepage_longitudinal",
        "creep_force_longitudinal",
        "stick_area",
        "slip_area",
        "creep_work",
        "friction_work",
    ]
]

# %% [markdown]
# The force grows from zero with the slope of the linear theory and saturates when the whole contact slips. The approximation of Vermeulen
# and Johnson needs only that slope. The work of friction per distance is force times creepage.

# %%
slope = ratio[0] / creepages[0]
fine = np.linspace(0.0, creepages[-1], 200)
approximation = 1.0 - np.maximum(1.0 - slope * fine / 3.0, 0.0) ** 3

figure, axes = plt.subplots(figsize=(5.6, 3.6))
axes.plot(100 * creepages, ratio, "o-", label="steady states")
axes.plot(100 * fine, approximation, "--", label="Vermeulen and Johnson")
axes.plot(100 * fine, np.minimum(slope * fine, 1.0), ":", label="linear")
axes.set(
    xlabel="creepage [%]",
    ylabel="tangential force over its limit [1]",
    ylim=(0.0, 1.1),
)
axes.legend()

# %%
assert (np.diff(ratio) > 0.0).all()
assert 0.999 < ratio[-1] <= 1.0
assert np.abs(ratio - np.interp(creepages, fine, approximation)).max() < 0.05
assert np.allclose(curve["friction_work"][1:], curve["creep_work"][1:], rtol=2e-3)

# %% [markdown]
# ## From rest to rolling
#
# The ball at rest bears a tangential force and slips in an annulus along the contact edge (Cattaneo and Mindlin). Then it rolls
# under the same force: material that has stuck since it entered moves through, and slip remains only at the trailing edge (Carter). The
# creepage follows from the force.

# %%
cell = WIDTH / DIVISIONS
start = ball(
    [
        meeframe.Step(tangential_force=[0.6 * FRICTION * FORCE, 0.0], increments=2),
        meeframe.Step(rolling={"distance": 24 * cell}),
        meeframe.Step(rolling={"steady": True}),
    ]
)
rolls = start.to_dataframe().iloc[3:]

figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6))
for step, name in ((2, "at rest"), ((3, 4), "after 4 cells"), ("last", "steady")):
    start.plot.section("tangential traction", step=step, ax=left)
    left.lines[-2].set_label(name)
for number, line in enumerate(left.lines):
    line.set_color(f"C{number // 2}")
left.legend()
right.plot(
    1e3 * rolls["rolled_distance"].iloc[:-1],
    100 * rolls["creepage_longitudinal"].iloc[:-1],
    "o-",
)
right.axhline(100 * rolls["creepage_longitudinal"].iloc[-1], ls="--")
right.set(xlabel="rolled distance [mm]", ylabel="creepage [%]")

# %%
transient, limit = rolls["creepage_longitudinal"].to_numpy()[-2:]
assert abs(transient / limit - 1.0) < 2e-3

# %% [markdown]
# ## Spin
#
# A contact that turns about its normal while it rolls is pushed sideways, although its creepages are zero. Slip begins at the contact edge, on the
# trailing side.

# %%
spinning = ball([steady(spin=10.0)])
spin = spinning.to_dataframe().iloc[-1]
spinning.plot.stick_slip(step="last")
print(
    f"lateral force / limit: {spin['creep_force_lateral'] / (FRICTION * FORCE):.3f}"
)

# %%
assert spin["creep_force_lateral"] > 0.1 * FRICTION * FORCE
assert abs(spin["creep_force_longitudinal"]) < 1e-3 * spin["creep_force_lateral"]
assert spin["torque"] > 0.0

# %% [markdown]
# ## A signal
#
# A grounded metal ball rolls over PZT-4 with its axis of poling in the surface, along the rolling direction. For reasons of symmetry, the pressure itself
# causes no charge. With a creepage, friction grows over a distance of about two contacts, and with it a charge that flows
# through the ball: a rolling sensor of the tangential force.

# %%
signal_width, signal_force = 0.8e-3, 20.0
signal = ball(
    [
        meeframe.Step(
            rolling={
                "distance": 24 * signal_width / DIVISIONS,
                "creepage": [2e-3, 0.0],
            }
        ),
        meeframe.Step(rolling={"steady": True, "creepage": [2e-3, 0.0]}),
    ],
    material={"name": "pzt-4", "rotation": {"axis": [0, 1, 0], "angle": "90 deg"}},
    force=signal_force,
    width=signal_width,
    conductivity={"electric": meeframe.StepConductivity(float("inf"))},
).to_dataframe()
rolled = 1e3 * signal["rolled_distance"].fillna(0.0).to_numpy()
charge, traction = (
    1e9 * signal["charge"].to_numpy(),
    signal["creep_force_longitudinal"].fillna(0.0).to_numpy(),
)

figure, axes = plt.subplots(figsize=(5.6, 3.6))
axes.plot(rolled[:-1], charge[:-1], "o-", label="rolling")
axes.axhline(charge[-1], ls="--", label="steady")
axes.set(xlabel="rolled distance [mm]", ylabel="charge out of the body [nC]")
axes.legend()

# %%
sensitivity = charge[1:] / traction[1:]
print(f"{sensitivity[-1]:.3f} nC/N; initial charge {charge[0]:.1e} nC")
assert np.ptp(sensitivity) < 0.05 * abs(sensitivity[-1])
assert abs(charge[-2] / charge[-1] - 1.0) < 0.03

# %% [markdown]
# ## Where to go next
#
# - [Rolling](../explanation/rolling.md): axes, signs, the scheme and its limits.
# - [Rolling contact](../validation/rolling.md): comparisons with Carter, Kalker and CONTACT, and creep coefficients.
# - [Load steps](../reference/case-files.md#rolling): the keys of `rolling` in case files.
# - [Sweep parameters](../howto/sweep.md): creep curves over loads, materials and friction in one call.
