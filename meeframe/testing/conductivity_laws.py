"""Conformance of conductivity laws; see meeframe.testing.contact."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array
from meeframe.laws.base import ConductivityLaw
from meeframe.testing.jumps import steepest
from meeframe.testing.requirements import ROUND_OFF, check_frozen, each, pure, require
from meeframe.testing.search import search_conductivities

_SAMPLES: Final = 400
_MIN_CONDUCTIVITY: Final = 1e-12
_TRACTION, _GAP, _DROP = range(3)
_COLUMN_NAMES: Final = ("under pressure", "across the gap", "with the drop")


def check_conductivity_law(
    law: ConductivityLaw,
    pressure: float = 1e6,
    seed: int = 0,
    gap: float = 1e-6,
    drop: float = 1e3,
    rectifies: bool = False,
) -> None:
    """Check a conductivity law at random states and at simple ones found by hypothesis.

    The law is frozen. Its conductivity is pure, local, >= 0 and not NaN, in contact and across any gap; continuous in
    the pressure, the gap and the drop, so that it jumps at zero traction only; independent of gap and drop unless the
    law is `across_gap`, in which case the flux does not decrease while the drop grows (`check_growing_flux`); and
    independent of the sign of the drop unless the law rectifies.

    Parameters
    ----------
    law : ConductivityLaw
        The conductivity law.
    pressure, gap, drop : float, optional
        Typical magnitudes of the random states [Pa], [m], [V] or [A].
    seed : int, optional
        Seed of the random states.
    rectifies : bool, optional
        Whether the conductivity may depend on the sign of the drop.

    Raises
    ------
    AssertionError
        If a property fails.
    """
    check_frozen(law)
    random = np.random.default_rng(seed)
    units = (pressure, gap, drop)
    states = _states(random, units)
    kappa = pure(lambda values: _conductivity(law, values), states, "conductivity")
    require(np.shape(kappa) == (len(states),), "conductivity has another shape than the traction", np.shape(kappa))
    each(kappa >= 0.0, "conductivity is negative or NaN", states, kappa)
    sample = random.permutation(len(states))[: _SAMPLES // 3]
    each(
        _equal(_conductivity(law, states[sample]), kappa[sample]),
        "conductivity depends on other nodes",
        states[sample],
        kappa[sample],
    )
    for column in (_GAP, _DROP) if not law.across_gap else ():
        changed = states.copy()
        changed[:, column] = random.permutation(states[:, column])
        message = f"conductivity changes {_COLUMN_NAMES[column]}, but the law is not across_gap"
        each(_equal(_conductivity(law, changed), kappa), message, changed, kappa)
    if not rectifies:
        mirrored = states * [1.0, 1.0, -1.0]
        each(
            _equal(_conductivity(law, mirrored), kappa), "conductivity depends on the sign of the drop", mirrored, kappa
        )
    for column in (_TRACTION, _GAP, _DROP):
        _check_jumps(law, states, column, units[column])
    if law.across_gap:
        check_growing_flux(law, pressure, seed, gap, drop)
    search_conductivities(law, *units)


def check_growing_flux(
    law: ConductivityLaw, pressure: float = 1e6, seed: int = 0, gap: float = 1e-6, drop: float = 1e3
) -> None:
    """Check that the flux kappa drop never decreases while the drop grows, so that it determines the drop.

    Parameters
    ----------
    law
        The conductivity law.
    pressure, gap, drop
        Typical magnitudes of the random states [Pa], [m], [V] or [A].
    seed
        Seed of the random states.
    """
    states = _states(np.random.default_rng(seed), (pressure, gap, drop))
    larger = states * [1.0, 1.0, 1.01]
    kappa, larger_kappa = _conductivity(law, states), _conductivity(law, larger)
    # conductivities are compared because the drop is zero for perfect conduction
    each(1.01 * larger_kappa >= (1.0 - ROUND_OFF) * kappa, "flux falls while the drop grows", states, kappa)


def _conductivity(law: ConductivityLaw, states: Array) -> Array:
    return law.conductivity(*states.T)


def _equal(one: Array, other: Array) -> NDArray[np.bool_]:
    """Return where two arrays are equal up to round-off, (n,).

    Powers can differ in the last digit between arrays of different lengths.
    """
    return np.isclose(one, other, rtol=ROUND_OFF, atol=0.0)


def _states(random: np.random.Generator, units: tuple[float, float, float]) -> Array:
    """Return tractions, gaps and drops (n, 3): the first half in contact, the others open; some without gap or drop."""
    size = 10.0 ** random.uniform(-6.0, 2.0, (2 * _SAMPLES, 3)) * units
    size[::7, _GAP] = 0.0
    size[::5, _DROP] = 0.0
    states: Array = size * np.array([-1.0, 1.0, 1.0])
    states[:, _DROP] *= random.choice([-1.0, 1.0], len(states))
    states[:_SAMPLES, _GAP] = 0.0
    states[_SAMPLES:, _TRACTION] = 0.0
    return states


def _check_jumps(law: ConductivityLaw, states: Array, column: int, unit: float) -> None:
    """Check that kappa has no jump along a line of tractions, gaps or drops, at random values of the others."""
    positive = unit * np.concatenate([[0.0], 10.0 ** np.linspace(-6.0, 2.0, _SAMPLES)])
    closed_states, open_states = states[:_SAMPLES], states[_SAMPLES:]
    if column == _TRACTION:
        _check_line(law, closed_states[1:], column, -positive[1:])
    elif column == _GAP:
        _check_line(law, open_states, column, positive)
    else:
        both = np.concatenate([-positive[:0:-1], positive])
        for side in (closed_states, open_states):
            _check_line(law, np.concatenate([side, side]), column, both)


def _check_line(law: ConductivityLaw, others: Array, column: int, line: Array) -> None:
    """Check by bisection that kappa has no jump between points (n + 1,) of a column; others: (n, 3)."""
    start, end = others.copy(), others.copy()
    start[:, column], end[:, column] = line[:-1], line[1:]
    finite = _conductivity(law, np.concatenate([start, end]))
    finite = finite[np.isfinite(finite) & (finite > 0.0)]
    typical = float(np.median(finite)) if finite.size else 1.0

    def transmissivity(states: Array) -> Array:
        """Return a number from zero (insulating) to one (perfect conduction) on the scale of a typical resistance."""
        return 1.0 / (1.0 + typical / np.maximum(_conductivity(law, states), _MIN_CONDUCTIVITY * typical))

    start, end, jumps = steepest(transmissivity, start, end)
    before, after = _conductivity(law, start), _conductivity(law, end)
    perfect = np.isinf(before) != np.isinf(after)
    each(~(jumps & perfect), f"conductivity jumps to infinity {_COLUMN_NAMES[column]}", start, before)
    each(~jumps, f"conductivity jumps {_COLUMN_NAMES[column]}", start, before)
