"""Check normal indentation with finite friction against Spence: an annulus around a sticking disc slips."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipkm1

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb
from meeframe.study.validate import Check, Curve, Item, Plot
from meeframe.system.dense import DenseSystem
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.load_path import PathStep, Position, follow

TITLE = "Spence: stick radius under a normal load"
SOURCE = (
    "Spence, Proc. R. Soc. A 305 (1968) 55 and J. Elasticity 5 (1975) 297, assuming that tangential tractions "
    "cause no normal displacement: the stick radius c/a = k is the same for punch, cone and sphere at every load, "
    "artanh(k) = (mu/beta) k K'(k), beta = (1 - 2 nu)/(2 (1 - nu))."
)
YOUNG = 200e9
STICKS = 1e-9
"""A cell sticks if its traction is below Coulomb's bound by more than this fraction."""


def stick_share(friction: float, poisson: float) -> float:
    """Return c/a; K'(k) is the elliptic integral of the complementary modulus."""
    ratio = friction * 2.0 * (1.0 - poisson) / (1.0 - 2.0 * poisson)
    return float(brentq(lambda k: np.arctanh(k) - ratio * k * ellipkm1(k**2), 1e-9, 1.0 - 1e-15, xtol=1e-15))


@dataclass(frozen=True, eq=False)
class State:
    """Cells of a contact of unit radius: r (n,), load (n, 5), weights (n,), friction coefficient."""

    r: Array
    load: Array
    weights: Array
    friction: float

    @property
    def ratio(self) -> Array:
        """Ratio of tangential traction and pressure, (n,), nan where open."""
        return np.hypot(self.load[:, 0], self.load[:, 1]) / np.where(self.load[:, 2] < 0.0, -self.load[:, 2], np.nan)

    @property
    def stick_share(self) -> float:
        """Square root of the ratio of sticking and contact area, nan if no cell touches."""
        touching = self.weights[self.load[:, 2] < 0.0].sum()
        sticking = self.ratio < (1.0 - STICKS) * self.friction
        return float(np.sqrt(self.weights[sticking].sum() / touching)) if touching else np.nan


def one_way(poisson: float, width: float, cells: int) -> DenseSystem:
    """Return the elastic half space without normal displacements due to tangential tractions."""
    system = elastic_half_space(YOUNG, poisson, width, cells)
    matrix = system.matrix.copy()
    matrix[:, 2, :, :2] = 0.0
    return replace(system, matrix=matrix)


def punch(friction: float, poisson: float, cells: int) -> State:
    """Press a flat punch of unit radius in one step: all fields grow in proportion."""
    system = one_way(poisson, 2.0, cells)
    r = np.hypot(system.points[:, 0], system.points[:, 1])
    position = Position(np.where(r < 1.0, -1e-3, np.inf), np.zeros((len(r), 2)))
    (step,) = follow(system, IsotropicCoulomb(friction), [position])
    return State(r, step.state.load, system.weights, friction)


def sphere(friction: float, poisson: float, cells: int, increments: int) -> list[tuple[float, State]]:
    """Press a sphere with equal increments of the contact radius up to one; return radius and state after each."""
    system = one_way(poisson, 2.1, cells)
    r = np.hypot(system.points[:, 0], system.points[:, 1])
    curvature, radii = 1e-2, np.arange(1, increments + 1) / increments
    path = [Position(curvature * (r**2 / 2.0 - a**2), np.zeros((len(r), 2))) for a in radii]
    steps: list[PathStep] = list(follow(system, IsotropicCoulomb(friction), path))
    return [(a, State(r, s.state.load, system.weights, friction)) for a, s in zip(radii, steps, strict=True)]


def run(quick: bool) -> Iterator[Item]:
    """Check the punch for several mu/beta, and the sphere along its path.

    Radii from areas of cells are accurate to a quarter of a cell. On the path of the sphere, the ratio has an error of
    first order in the steps (16 cells: its mean is too small by 0.027, 0.012, 0.005 for 16, 32, 64 steps), because slip
    is counted from step to step; the mean is extrapolated in their number.
    """
    cells = 16 if quick else 24
    tolerance = 0.5 / cells
    cases = ((0.2, 0.0), (0.2, 0.3)) if quick else ((0.2, 0.0), (0.3, 0.0), (0.15, 0.3), (0.2, 0.3), (0.1, 0.4))
    shares = []
    for friction, poisson in cases:
        state, exact = punch(friction, poisson, cells), stick_share(friction, poisson)
        name = f"flat punch, mu = {friction:g}, nu = {poisson:g}: c/a, {cells} x {cells} cells"
        yield Check(name, state.stick_share, exact, tolerance, absolute=True)
        shares.append((friction * 2.0 * (1.0 - poisson) / (1.0 - 2.0 * poisson), state.stick_share))
    friction, poisson = 0.2, 0.3
    coarse, result = (sphere(friction, poisson, cells, steps) for steps in (cells, 2 * cells))
    exact = stick_share(friction, poisson)
    radii = np.array([a for a, _ in result])
    computed = np.array([state.stick_share for _, state in result])
    name = f"sphere, mu = {friction:g}, nu = {poisson:g}"
    mean = 2.0 * _mean_share(result) - _mean_share(coarse)
    words = f"{name}: c/a, mean over the second half of the path, from {cells} and {2 * cells} steps"
    yield Check(words, mean, exact, tolerance / 2.0, absolute=True)
    yield Check(
        f"{name}: c/a at the end, {cells} x {cells} cells", float(computed[-1]), exact, tolerance, absolute=True
    )
    yield from _plots(shares, radii, computed, exact, result[-1][1], name)


def _mean_share(path: list[tuple[float, State]]) -> float:
    """Return the mean ratio over the second half of the path of a sphere."""
    return float(np.mean([state.stick_share for radius, state in path if radius > 0.5]))


def _plots(
    shares: list[tuple[float, float]], radii: Array, computed: Array, exact: float, last: State, name: str
) -> Iterator[Plot]:
    ratios = np.linspace(0.05, 1.0, 100)
    # nu = 0 has beta = 1/2
    curve = Curve("Spence", ratios, np.array([stick_share(ratio / 2.0, 0.0) for ratio in ratios]))
    points = Curve("flat punch", *np.array(shares).T, points=True)
    yield Plot("Stick radius relative to contact radius", "mu / beta", "c/a", (curve, points))
    curves = (Curve("Spence", radii, np.full_like(radii, exact)), Curve("computed", radii, computed, points=True))
    yield Plot(f"{name}: self-similar", "contact radius / last contact radius", "c/a", curves)
    bound = Curve("mu", np.array([0.0, 1.0]), np.full(2, last.friction))
    edge = Curve("c/a", np.full(2, exact), np.array([0.0, last.friction]))
    cells = Curve("cells", last.r, last.ratio, points=True)
    yield Plot(f"{name}: ratio of tangential traction and pressure", "r/a", "t/p", (bound, edge, cells))
