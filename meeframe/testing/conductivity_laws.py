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
_NOTHING: Final = 1e-12
_TRACTION, _GAP, _DROP = range(3)
_WHERE: Final = ("under pressure", "across the gap", "with the drop")


def check_conductivity_law(
    law: ConductivityLaw,
    pressure: float = 1e6,
    seed: int = 0,
    gap: float = 1e-6,
    drop: float = 1e3,
    rectifies: bool = False,
) -> None:
    """Check that a law is frozen and its conductivity pure, local, >= 0 and not NaN, in contact and across any gap;
    continuous under pressure, in the gap and in the drop, so that it jumps at zero traction only; the same whatever the
    gap and the drop unless the law is `across_gap`, and then of a flux that does not fall while the drop grows
    (check_growing_flux); the same for both signs of the drop unless it `rectifies`.

    pressure [Pa], gap [m], drop [V] or [A]: magnitudes of the random states; pass some that are typical for the law.
    Beside them hypothesis looks for simple states that break it.
    """
    check_frozen(law)
    random = np.random.default_rng(seed)
    units = (pressure, gap, drop)
    states = _states(random, units)
    kappa = pure(lambda given: _conductivity(law, given), states, "conductivity")
    require(np.shape(kappa) == (len(states),), "conductivity has another shape than the traction", np.shape(kappa))
    each(kappa >= 0.0, "conductivity is negative or NaN", states, kappa)
    some = random.permutation(len(states))[: _SAMPLES // 3]
    each(
        _same(_conductivity(law, states[some]), kappa[some]),
        "conductivity depends on other nodes",
        states[some],
        kappa[some],
    )
    for column in (_GAP, _DROP) if not law.across_gap else ():
        moved = states.copy()
        moved[:, column] = random.permutation(states[:, column])
        what = f"conductivity changes {_WHERE[column]}, but the law is not across_gap"
        each(_same(_conductivity(law, moved), kappa), what, moved, kappa)
    if not rectifies:
        turned = states * [1.0, 1.0, -1.0]
        each(_same(_conductivity(law, turned), kappa), "conductivity depends on the sign of the drop", turned, kappa)
    for column in (_TRACTION, _GAP, _DROP):
        _check_jumps(law, states, column, units[column])
    if law.across_gap:
        check_growing_flux(law, pressure, seed, gap, drop)
    search_conductivities(law, *units)


def check_growing_flux(
    law: ConductivityLaw, pressure: float = 1e6, seed: int = 0, gap: float = 1e-6, drop: float = 1e3
) -> None:
    """Check that the flux kappa drop never falls while the drop grows, so that it determines the drop."""
    states = _states(np.random.default_rng(seed), (pressure, gap, drop))
    further = states * [1.0, 1.0, 1.01]
    kappa, beyond = _conductivity(law, states), _conductivity(law, further)
    # compared as kappa: a perfect conductor leaves no drop to be multiplied with
    each(1.01 * beyond >= (1.0 - ROUND_OFF) * kappa, "flux falls while the drop grows", states, kappa)


def _conductivity(law: ConductivityLaw, states: Array) -> Array:
    return law.conductivity(*states.T)


def _same(one: Array, other: Array) -> NDArray[np.bool_]:
    """Return where they are equal but for round-off, (n,): powers need not be the same number in arrays of other
    lengths."""
    return np.isclose(one, other, rtol=ROUND_OFF, atol=0.0)


def _states(random: np.random.Generator, units: tuple[float, float, float]) -> Array:
    """Return (n, 3) tractions, gaps, drops: the first half in contact, the others apart; some with no gap or drop."""
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
    contact_fraction, apart = states[:_SAMPLES], states[_SAMPLES:]
    if column == _TRACTION:
        _check_line(law, contact_fraction[1:], column, -positive[1:])
    elif column == _GAP:
        _check_line(law, apart, column, positive)
    else:
        both = np.concatenate([-positive[:0:-1], positive])
        for side in (contact_fraction, apart):
            _check_line(law, np.concatenate([side, side]), column, both)


def _check_line(law: ConductivityLaw, others: Array, column: int, line: Array) -> None:
    """Check that there is no jump between points (n + 1,) of a column; others: (n, 3). Halves intervals where kappa
    differs."""
    start, end = others.copy(), others.copy()
    start[:, column], end[:, column] = line[:-1], line[1:]
    finite = _conductivity(law, np.concatenate([start, end]))
    finite = finite[np.isfinite(finite) & (finite > 0.0)]
    typical = float(np.median(finite)) if finite.size else 1.0

    def transmissivity(states: Array) -> Array:
        """Return a number between zero (insulating) and one (perfect conduction) on the scale of a typical
        resistance."""
        return 1.0 / (1.0 + typical / np.maximum(_conductivity(law, states), _NOTHING * typical))

    start, end, jumps = steepest(transmissivity, start, end)
    before, after = _conductivity(law, start), _conductivity(law, end)
    perfect = np.isinf(before) != np.isinf(after)
    each(~(jumps & perfect), f"conductivity jumps to infinity {_WHERE[column]}", start, before)
    each(~jumps, f"conductivity jumps {_WHERE[column]}", start, before)
