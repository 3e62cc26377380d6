"""Conformance of wear laws; see meeframe.testing.contact."""

from typing import Final

import numpy as np

from meeframe.fields import Array
from meeframe.laws.wear import WearLaw
from meeframe.testing.jumps import steepest
from meeframe.testing.requirements import ROUND_OFF, check_frozen, each, pure, require

_SAMPLES: Final = 400
_PRESSURE, _SPEED, _WORN = range(3)


def check_wear_law(law: WearLaw, pressure: float = 1e6, speed: float = 1.0, worn: float = 1e-6, seed: int = 0) -> None:
    """Check a wear law at random states.

    The law is frozen. Its rate is pure, local, finite and >= 0, zero without pressure, continuous in the pressure, does
    not decrease with it, and is independent of the speed unless the law needs a duration.

    Parameters
    ----------
    law : WearLaw
        The wear law.
    pressure, speed, worn : float, optional
        Typical magnitudes of the random states [Pa], [m/s], [m].
    seed : int, optional
        Seed of the random states.

    Raises
    ------
    AssertionError
        If a property fails.
    """
    check_frozen(law)
    random = np.random.default_rng(seed)
    states = 10.0 ** random.uniform(-6.0, 2.0, (_SAMPLES, 3)) * (pressure, speed, worn)
    states[::7, _PRESSURE] = states[::5, _SPEED] = states[::3, _WORN] = 0.0
    rate = pure(lambda values: _rate(law, values), states, "wear rate")
    require(np.shape(rate) == (_SAMPLES,), "wear rate has another shape than the pressure", np.shape(rate))
    each(np.isfinite(rate), "wear rate is not finite", states, rate)
    each(rate >= 0.0, "wear rate is negative", states, rate)
    each((rate == 0.0) | (states[:, _PRESSURE] > 0.0), "wear rate is positive without pressure", states, rate)
    sample = random.permutation(_SAMPLES)[: _SAMPLES // 3]
    alone = _rate(law, states[sample])
    each(np.isclose(alone, rate[sample], rtol=ROUND_OFF, atol=0.0), "wear rate depends on other nodes", states, alone)
    if not law.needs_duration:
        changed = states.copy()
        changed[:, _SPEED] = random.permutation(states[:, _SPEED])
        same = np.isclose(_rate(law, changed), rate, rtol=ROUND_OFF, atol=0.0)
        each(same, "wear rate depends on the speed, but the law has no needs_duration", states, rate)
    _check_pressure(law, states, pressure)


def _check_pressure(law: WearLaw, states: Array, unit: float) -> None:
    """Check that the rate neither jumps nor falls along a line of pressures, at the other states (n, 3)."""
    line = unit * np.concatenate([[0.0], 10.0 ** np.linspace(-6.0, 2.0, len(states))])
    start, end = states.copy(), states.copy()
    start[:, _PRESSURE], end[:, _PRESSURE] = line[:-1], line[1:]
    before, after = _rate(law, start), _rate(law, end)
    each(after >= (1.0 - ROUND_OFF) * before, "wear rate falls while the pressure grows", end, after)
    typical = float(np.median(after[after > 0.0])) if (after > 0.0).any() else 1.0

    def bounded(values: Array) -> Array:
        """Return a number between zero and one that grows with the rate."""
        rate = _rate(law, values)
        return np.asarray(rate / (rate + typical))

    start, _, jumps = steepest(bounded, start, end)
    each(~jumps, "wear rate jumps under pressure", start, _rate(law, start))


def _rate(law: WearLaw, states: Array) -> Array:
    """Return the rates of states (n, 3)."""
    return law.rate(*states.T)
