"""Floating conductors: potentials of the indenter that follow from prescribed total fluxes.

With the potentials v of the floating conductors the flux equations on the conducting (node, potential) pairs A become
    (C_AA + R) f = difference + mode_A v,   measure_A : f = total.
The v are eliminated by the capacitance measure_A : (C_AA + R)^-1 mode_A, which has as many rows as there are of them.
Where nothing conducts, or nothing in contact with them, the potentials are not determined and stay unchanged.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.free_motion import potentials
from meeframe.contact.problem import ContactProblem
from meeframe.fields import POTENTIALS, Array, Indices


@dataclass(frozen=True, eq=False)
class Floating:
    """Potentials of the indenter that prescribed total fluxes determine.

    Attributes
    ----------
    numbers : Indices
        (j,), numbers among the problem's prescribed resultants.
    totals : Array
        (j,), prescribed totals, SI units.
    flux : Array
        (a, j), flux densities on the conducting pairs due to unit potentials.
    measure : Array
        (j, a), weights of the totals.
    elastance : Array
        (j, j), potentials due to unit totals.
    """

    numbers: Indices
    totals: Array
    flux: Array
    measure: Array
    elastance: Array

    @classmethod
    def of(cls, problem: ContactProblem, conducts: Mask, solve: Callable[[Array], Array]) -> "Floating":
        """Return the floating conductors on the pairs (n, channels) that conduct.

        solve: returns flux densities (a,) that raise the negated potentials by differences (a,).
        """
        modes = {i: problem.prescribed_resultants[i].mode[:, POTENTIALS][conducts] for i in potentials(problem)}
        numbers = np.array([i for i, mode in modes.items() if mode.any()], int)
        if numbers.size == 0:
            empty = np.zeros((0, 0))
            return cls(numbers, np.zeros(0), empty, empty, empty)
        resultants = [problem.prescribed_resultants[i] for i in numbers]
        flux = np.column_stack([solve(modes[i]) for i in numbers])
        measure = np.stack([resultant.measure[:, POTENTIALS][conducts] for resultant in resultants])
        capacitance = measure @ flux
        size = np.sqrt(np.abs(np.diag(capacitance)))
        size[size == 0.0] = 1.0
        elastance = np.linalg.pinv(capacitance / size[:, None] / size) / size[:, None] / size
        return cls(numbers, np.array([resultant.total for resultant in resultants]), flux, measure, elastance)

    def balance(self, flux: Array, totals: Array | float) -> tuple[Array, Array]:
        """Return flux densities (a,) with the totals (j,), and the potentials (j,).

        flux: densities (a,) without a potential.
        """
        if self.numbers.size == 0:
            return flux, np.zeros(0)
        potential = self.elastance @ (totals - self.measure @ flux)
        return flux + self.flux @ potential, potential
