"""The contact problem as one nonsmooth equation, and its linearisation node by node (eqs. 27-29).

With the trial traction t* = p + r S g of a load (p, f) and a closed fraction c, the residual of a node has six rows:
    p - project(t*)                                 contact,
    T (-phi + phi_o) + (1 - T) own f                either potential, T = own / (own + R) in [0, 1],
    c - clip(c - t*_nu / sigma, 0, 1)               at nodes that graze, else c - [t*_nu < 0],
T, the transmissivity, grows from 0 (insulated) to 1 (perfect conductor) with the conductivity and is interpolated by c
as in meeframe.solvers.conduction. The gap depends on the load through the compliance C alone, so that the generalised
Jacobian is A + B C with blocks A (6, 6) and B (6, 5) of each node: all that the linear solvers need.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.core.contact import ContactProblem, contact_gap
from meeframe.core.fields import MECHANICAL, Array
from meeframe.solvers.conduction import TOUCHING, Mask, own_response, resistances
from meeframe.solvers.scales import Scales, problem_scales

LOAD: Final = slice(0, 5)
CLOSED: Final = 5
FLUX: Final = slice(3, 5)
_DIFFERENCE: Final = 6e-6


@dataclass(frozen=True, eq=False)
class Equation:
    """The nonsmooth equation of a problem.

    own: (n, 2) own responses of the potentials; r: Pa/m; blocks: (n, 5, 5) own responses.
    """

    problem: ContactProblem
    scales: Scales
    blocks: Array
    own: Array
    r: Array

    @classmethod
    def of(cls, problem: ContactProblem, factor=1.0) -> "Equation":
        blocks = problem.system.diagonal_blocks()
        return cls(problem, problem_scales(problem), blocks, own_response(problem), np.full(len(blocks), factor / problem_scales(problem).normal_compliance))

    def at(self, load: Array, closed: Array, grazing: Mask) -> "Point":
        """The equation at a load (n, 5); closed: (n,) of the grazing nodes (n,), of the others it follows."""
        displacement = self.problem.system.offset + self.problem.system.apply(load)
        gap = contact_gap(self.problem, displacement)
        law = self.problem.contact_law
        trial = load[:, MECHANICAL].copy()
        trial[:, :2] += self.r[:, None] * (gap[:, :2] @ law.tangential_scaling())
        trial[:, 2] += self.r * gap[:, 2]
        touching = trial[:, 2] < 0.0
        closed = np.where(grazing, closed, touching)
        clipped = np.clip(closed, 0.0, 1.0)
        conducting = self._transmissivity(load[:, 2], np.ones_like(closed))
        jump = conducting - self._transmissivity(load[:, 2], np.zeros_like(closed))
        transmissivity = conducting - (1.0 - clipped[:, None]) * jump
        difference = displacement[:, FLUX] + self.problem.potentials
        drive = difference - self.own * load[:, FLUX]
        residual = np.zeros((len(load), 6))
        residual[:, MECHANICAL] = (load[:, MECHANICAL] - law.project(trial)) / self.scales.pressure
        residual[:, FLUX] = (transmissivity * drive + self.own * load[:, FLUX]) / self.scales.displacement[FLUX]
        flux_gain = (np.abs(self.blocks[:, 2, FLUX]*jump * drive) / self.own).sum(axis=1)
        sigma = self.r * flux_gain + np.finfo(float).tiny
        switch = closed - trial[:, 2] / sigma
        residual[:, CLOSED] = np.where(grazing, closed - np.clip(switch, 0.0, 1.0), 0.0)
        return Point(self, load, closed, grazing, displacement, trial, transmissivity, jump, drive, sigma, switch, residual)

    def _transmissivity(self, normal_traction: Array, closed: Array) -> Array:
        return np.asarray(self.own / (self.own + resistances(self.problem, normal_traction, closed, self.own)))

    def transmissivity_slope(self, normal_traction: Array) -> Array:
        """dT/dp_nu of closed contacts, (n, 2), by central differences on a logarithmic scale."""
        here = np.minimum(normal_traction, -1e-9 * self.scales.pressure)
        ones = np.ones_like(here)
        ahead, behind = (self._transmissivity(here * (1.0 + h), ones) for h in (_DIFFERENCE, -_DIFFERENCE))
        return np.asarray((ahead - behind) / (2.0 * _DIFFERENCE * here)[:, None])


@dataclass(frozen=True, eq=False)
class Point:
    """The equation at a state."""

    equation: Equation
    load: Array
    closed: Array
    grazing: Mask
    displacement: Array
    trial: Array
    transmissivity: Array
    jump: Array
    drive: Array
    sigma: Array
    switch: Array
    residual: Array

    @property
    def merit(self) -> float:
        """Root of the mean square of the residual over nodes"""
        merit = float(np.sqrt((self.residual**2).sum() / len(self.residual)))
        return merit if np.isfinite(merit) else np.inf

    def linearise(self) -> "Blocks":
        equation = self.equation
        law, scales = equation.problem.contact_law, equation.scales
        n = len(self.load)
        a, b = np.zeros((n, 6, 6)), np.zeros((n, 6, 5))
        between = self.grazing & (self.switch > 0.0) & (self.switch < 1.0)
        tangent = law.tangent(self.trial)
        tangent[between] = 0.0
        residual = self.residual.copy()
        residual[between, 0:3] = self.load[between, :3] / scales.pressure
        step = np.zeros((n, 3, 3))
        step[:, :2, :2] = equation.r[:, None, None] * law.tangential_scaling()
        step[:, 2, 2] = equation.r
        a[:, :3, :3] = (np.eye(3) - tangent) / scales.pressure
        b[:, :3, :3] = tangent @ step / scales.pressure
        scale = scales.displacement[FLUX]
        slope = np.clip(self.closed, 0.0, 1.0)[:, None] * equation.transmissivity_slope(self.load[:, 2])
        for k in (0, 1):
            a[:, 3 + k, 3 + k] = equation.own[:, k] * (1.0 - self.transmissivity[:, k]) / scale[k]
            a[:, 3 + k, 2] = self.drive[:, k] * slope[:, k] / scale[k]
            a[:, 3 + k, CLOSED] = self.drive[:, k] * self.jump[:, k] * between / scale[k]
            b[:, 3 + k, 3 + k] = self.transmissivity[:, k] / scale[k]
        a[:, CLOSED, CLOSED] = ~between
        b[between, CLOSED, 2] = -equation.r[between] / self.sigma[between]
        residual[between, CLOSED] = ((self.trial[:, 2]-self.load[:,2]) / self.sigma)[between]
        return Blocks(a, b, residual)


@dataclass(frozen=True, eq=False)
class Blocks:
    """(A + B C) step = -residual."""

    a: Array
    b: Array
    residual: Array
