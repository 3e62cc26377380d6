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
# # Write a friction law and check it
#
# You write a law of friction in fewer than 30 lines, check it with the conformance kit, solve a contact with it, and compare
# the result with an integral in closed form. You also see how the kit reports a mistake.
#
# The coefficient of friction of many pairs, such as ice, polymers and solid lubricants, falls with the pressure $p$. A simple
# law with this property is
#
# $$|t_\tau| \le \frac{\mu\, p}{1 + p/p_{1/2}},$$
#
# which is Coulomb's law at small pressures, has half of the coefficient at $p_{1/2}$, and tends to the shear strength
# $\mu\, p_{1/2}$ at large pressures.

# %%
import math
from dataclasses import dataclass
from typing import Annotated

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import quad

import meeframe
from meeframe.plugin import Array, ContactLaw, Quantity, check_quantities

plt.style.use(meeframe.STYLE)

# %% [markdown]
# ## The law
#
# A law is a frozen dataclass with two methods. `project` receives a trial traction $(t_1, t_2, t_\nu)$ at each node and returns
# the admissible one; compression is negative. `tangential_scaling` is the identity unless friction depends on the direction.


# %%
@dataclass(frozen=True)
class FallingCoulomb(ContactLaw):
    """|t_tau| <= mu p / (1 + p / half_pressure)."""

    mu: Annotated[float, Quantity("", gt=0, lt=math.inf)]
    half_pressure: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def limit(self, pressure: Array) -> Array:
        """Return the largest tangential traction [Pa]."""
        return self.mu * pressure / (1 + pressure / self.half_pressure)

    def project(self, trial: Array) -> Array:
        """Project tractions (n, 3) [Pa] on the disc of radius `limit`."""
        normal = np.minimum(trial[:, 2:], 0.0)
        size = np.linalg.norm(trial[:, :2], axis=1, keepdims=True)
        limit = self.limit(-normal)
        factor = np.divide(limit, size, out=np.ones_like(size), where=size > limit)
        return np.hstack([trial[:, :2] * factor, normal])

    def tangential_scaling(self) -> Array:
        """Return the identity: friction is isotropic."""
        return np.eye(2)


law = FallingCoulomb(mu=0.4, half_pressure=300e6)

# %% [markdown]
# ## Check the contract
#
# The kit projects hundreds of tractions of the magnitude that you name, and searches for simple ones that break a property: the
# result must be admissible, must not change when it is projected again, must be independent for each node, and slip must
# dissipate.

# %%
from meeframe.testing import check_contact_law
from meeframe.testing.contact import check_associated, check_isotropic

check_contact_law(law, pressure=3e8)
check_isotropic(law, pressure=3e8)
check_associated(law, pressure=3e8)
print("the law fulfils its contract")

# %% [markdown]
# An easy mistake is the wrong sign of the pressure. The kit finds it, and states an input and the reason:


# %%
class WrongSign(FallingCoulomb):
    def project(self, trial: Array) -> Array:
        """Project tractions as if the surfaces were glued: the trial traction is never open."""
        return super().project(np.hstack([trial[:, :2], -np.abs(trial[:, 2:])]))


try:
    check_contact_law(WrongSign(mu=0.4, half_pressure=300e6), pressure=3e8)
except AssertionError as error:
    print(str(error).strip())
else:
    raise AssertionError("the kit accepted a law that is wrong")

# %% [markdown]
# ## Solve a contact
#
# A sphere is pressed against an incompressible half space, in which pressure and tangential displacement are not coupled, and
# dragged until the whole contact slides. The law is used at once; a case file needs it as a
# [plugin](../tutorials/first-friction-law.md#a-package).


# %%
def drag(law):
    return meeframe.Case(
        title="Dragged sphere",
        material={
            "name": "isotropic",
            "young_modulus": "210 GPa",
            "poisson_ratio": 0.4999,
        },
        mesh=meeframe.mesh.half_space("1.6 mm", divisions=32),
        formulation=meeframe.formulation("half-space"),
        indenter=meeframe.Sphere("100 mm"),
        contact=law,
        steps=[
            meeframe.Step(approach="4 um"),
            meeframe.Step(translation=["2.5 um", 0], increments=8),
        ],
    ).solve()


falling = drag(law)
coulomb = drag(meeframe.IsotropicCoulomb(0.4))

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for run, name in ((coulomb, "Coulomb, 0.4"), (falling, "falling coefficient")):
    curve = run.to_dataframe()
    left.plot(
        1e6 * curve["translation_1"], curve["tangential_force_1"], "o-", label=name
    )
    section = run.to_xarray().isel(increment=-1).sel(y=0, method="nearest")
    right.plot(
        1e3 * section.x, 1e-6 * section["traction_x"], "o-", ms=3, label=name
    )
left.set(xlabel="translation [µm]", ylabel="tangential force [N]")
left.legend()
right.set(xlabel="x [mm]", ylabel="tangential traction at the end [MPa]")

# %% [markdown]
# Where Coulomb's traction has its peak, the traction of the new law is almost flat: the coefficient is smallest where the pressure is
# largest.
#
# ## Check the result
#
# When the whole contact slides, the traction is at its limit everywhere, and the pressure is that of Hertz. The force is then an
# integral over the contact:
#
# $$T = \int_0^a \frac{\mu\, p(r)}{1 + p(r)/p_{1/2}}\, 2\pi r\, dr, \qquad p(r) = p_0 \sqrt{1 - r^2/a^2}.$$

# %%
from meeframe.testing.closed_forms_friction import HertzContact

hertz = HertzContact(210e9, 0.4999, 0.1, 4e-6)


def sliding_force(law):
    def ring(r):
        return law.limit(hertz.pressure(np.array([r])))[0] * 2 * np.pi * r

    return quad(ring, 0, hertz.contact_radius)[0]


computed = falling.to_dataframe()["tangential_force_1"].iloc[-1]
exact = sliding_force(law)
print(
    f"sliding force: computed {computed:.2f} N, integral {exact:.2f} N, "
    f"deviation {computed / exact - 1:.2%}"
)
assert abs(computed / exact - 1) < 0.01

# %% [markdown]
# At each node, the traction is at the limit in sliding and below it in stick:

# %%
for increment in falling:
    traction = np.linalg.norm(increment.traction[:, :2], axis=1)
    limit = law.limit(-increment.traction[:, 2])
    assert (traction <= limit * (1 + 1e-6) + 1.0).all()
slides = falling[-1].touching
ratio = traction[slides] / limit[slides]
print(
    f"traction over limit when all slides: {ratio.min():.6f} to {ratio.max():.6f}"
)
assert abs(ratio - 1).max() < 1e-5

# %% [markdown]
# With Coulomb's law, the same motion does not yet slide everywhere; the map shows the stick zone half way.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
coulomb.plot.stick_slip(left, step=(2, 4))
falling.plot.stick_slip(right, step=(2, 1))
left.set_title("Coulomb, half way")
right.set_title("falling coefficient, first increment")

# %% [markdown]
# ## Where to go next
#
# - [Your first friction law](../tutorials/first-friction-law.md) turns a law into a file for `--plugin`, and into a package
# - [Contracts](../howto/plugins.md#contracts): interface compliance, adhesion, memory and rate in a law
# - [Friction laws](../reference/laws-friction.md) that exist already
# - [Hysteresis and dissipation](hysteresis.py) under a cyclic load
