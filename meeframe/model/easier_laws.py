"""Laws that make an increment easier to solve, whose states are initial guesses for the solution under its own laws."""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from meeframe.contact.problem import ContactProblem
from meeframe.fields import Array
from meeframe.laws.base import ConductivityLaw, ContactLaw


@dataclass(frozen=True)
class CappedLaw(ContactLaw):
    """A contact law with friction of at most a multiple of the pressure, so that its limit does not jump.

    Attributes
    ----------
    law : ContactLaw
        The law.
    ratio : float
        Largest friction over the pressure.
    """

    law: ContactLaw
    ratio: float

    def project(self, trial: Array) -> Array:
        """Return the projection of the law, shortened along its friction to the largest one, (n, 3) [Pa]."""
        return self._shorten(self.law.project(trial))

    def tangential_scaling(self) -> Array:
        """Return that of the law."""
        return self.law.tangential_scaling()

    def __getattr__(self, name: str) -> Any:
        """Return an optional method of the law."""
        method = getattr(self.law, name)
        return method if name != "resolve" else lambda *arguments: self._shorten(method(*arguments))

    def _shorten(self, traction: Array) -> Array:
        size, limit = np.linalg.norm(traction[:, :2], axis=1), -self.ratio * traction[:, 2]
        factor = np.divide(limit, size, out=np.ones_like(size), where=size > limit)
        return np.column_stack([factor[:, None] * traction[:, :2], traction[:, 2]])


@dataclass(frozen=True)
class ScaledLaw(ConductivityLaw):
    """A multiple of a law of conductivity.

    Attributes
    ----------
    law : ConductivityLaw
        The law.
    factor : float
        Factor > 0 of the conductivity.
    """

    law: ConductivityLaw
    factor: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return the multiple of the conductivity, (n,)."""
        return self.factor * self.law.conductivity(normal_traction, gap, drop)


class ScaledLawAcrossGap(ScaledLaw):
    """A multiple of a law of conductivity that depends on the gap or the drop."""

    across_gap = True


@dataclass(frozen=True)
class Easing:
    """Change of the laws that makes an increment easier to solve.

    Attributes
    ----------
    ratio : float, optional
        Largest friction over the pressure.
    factor : float, optional
        Factor of all conductivities.
    """

    ratio: float = np.inf
    factor: float = 1.0

    def apply(self, problem: ContactProblem) -> ContactProblem:
        """Return a problem under the changed laws."""
        law = problem.contact_law if self.ratio == np.inf else CappedLaw(problem.contact_law, self.ratio)
        if self.factor == 1.0:
            return replace(problem, contact_law=law)
        kinds = (ScaledLawAcrossGap if channel.law.across_gap else ScaledLaw for channel in problem.channels)
        channels = (
            replace(channel, law=kind(channel.law, self.factor)) if channel.is_conducting else channel
            for channel, kind in zip(problem.channels, kinds, strict=True)
        )
        return replace(problem, contact_law=law, channels=tuple(channels))


EXACT: Final = Easing()
"""No change of the laws."""
