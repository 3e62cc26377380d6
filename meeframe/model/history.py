"""Load histories: the controls between one converged state and the next."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from meeframe.contact.problem import ContactState
from meeframe.fields import MECHANICAL, Array
from meeframe.indenters.base import FORCE_RATIO, IndenterMotions
from meeframe.laws.base import ContactLaw

Controls = Mapping[str, Array]
"""Controls in force by key: each motion itself or what is prescribed instead, (1,) or (2,), SI."""


@dataclass(frozen=True, eq=False)
class ConvergedState:
    """Converged state from which a computation continues.

    motions: names and indices of the indenter's motions; motion, resultants: (motions.size,) of the indenter, at these
    indices; total_slip: (n, 2), slip_path and wear: (n,) [m] as in StepResult; state: of the contact zone, None for the
    undeformed body; rolled, travel: distance over which the contact has rolled, and its displacement
    (2,) over the material along e1 and e2 of the indenter's axes [m]; cycles: of steady rolling, in which the
    surfaces have worn.
    """

    motions: IndenterMotions

    motion: Array
    resultants: Array
    total_slip: Array
    slip_path: Array
    wear: Array
    state: ContactState | None
    rolled: float = 0.0
    travel: Array = field(default_factory=lambda: np.zeros(2))
    cycles: float = 0.0

    def value(self, key: str) -> Array:
        """Return the value of a control that would reproduce this state, (1,) or (2,)."""
        if key in self.motions.motions:
            return self.motion[self.motions.columns[key]]
        value = self.resultants[self.motions.columns[key]]
        if key == FORCE_RATIO:
            pressing = self.resultants[self.motions.columns["normal_force"]]
            value = np.divide(value, pressing, out=np.zeros_like(value), where=pressing > 0.0)
        return value


def at_rest(motions: IndenterMotions, potentials: Mapping[str, float], n: int) -> ConvergedState:
    """Return the initial state of n nodes without load.

    The indenter just touches and has the given potentials, by name.
    """
    motion = np.zeros(motions.size)
    for name, potential in potentials.items():
        motion[motions.columns[name]] = potential
    distances = np.broadcast_to(0.0, (n, 2)), np.broadcast_to(0.0, n), np.broadcast_to(0.0, n)
    return ConvergedState(motions, motion, np.zeros(motions.size), *distances, None)


def hold_motions(start: ConvergedState, prescribed: Controls) -> Controls:
    """Return the prescribed resultants, with every other motion fixed at its present value."""
    return ramp({key: start.value(key) for key in start.motions.motions}, start, prescribed)


def ramp(controls: Controls, start: ConvergedState, prescribed: Controls, fraction: float = 1.0) -> Controls:
    """Return the controls after a fraction of the linear way from a step's start to its prescribed values.

    Controls that are not prescribed remain.
    """
    columns = start.motions.columns
    determined = [columns[key] for key in prescribed]
    others = {key: value for key, value in controls.items() if columns[key] not in determined}
    return others | {key: (1.0 - fraction) * start.value(key) + fraction * value for key, value in prescribed.items()}


def extrapolate(law: ContactLaw, before: ConvergedState, here: ConvergedState) -> ContactState | None:
    """Predict the state after another increment of the same size as the last one, as an initial guess for solvers.

    Parameters
    ----------
    law
        Contact law, which makes the predicted tractions admissible.
    before, here
        Converged states at the beginning and at the end of the last increment.

    Returns
    -------
    ContactState or None
        Linear continuation of loads and free motions; None if one of the states is the undeformed body.
    """
    if before.state is None or here.state is None:
        return None
    load = 2.0 * here.state.load - before.state.load
    load[:, MECHANICAL] = law.project(load[:, MECHANICAL])
    return replace(here.state, load=load)
