"""Load histories: what is in force between one converged state and the next."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from meeframe.contact.problem import ContactState
from meeframe.fields import MECHANICAL, Array
from meeframe.indenters.base import COLUMNS, FORCE_RATIO, MOTIONS, N_MOTIONS
from meeframe.laws.base import ContactLaw

Controls = Mapping[str, Array]
"""What is in force, one key for each motion: the motion itself or what is prescribed instead, (1,) or (2,), SI."""


@dataclass(frozen=True, eq=False)
class Converged:
    """A converged state to go on from.

    motion, resultants: (8,) of the indenter, at the places of meeframe.indenters.base.COLUMNS; total_slip: (n, 2) and
    slip_path: (n,) [m] as in StepResult; state: of the contact zone, None for the undeformed body.
    """

    motion: Array
    resultants: Array
    total_slip: Array
    slip_path: Array
    state: ContactState | None

    def value(self, key: str) -> Array:
        """What could have been prescribed to have this state, (1,) or (2,)."""
        if key in MOTIONS:
            return self.motion[COLUMNS[key]]
        value = self.resultants[COLUMNS[key]]
        if key == FORCE_RATIO:
            pressing = self.resultants[COLUMNS["normal_force"]]
            value = np.divide(value, pressing, out=np.zeros_like(value), where=pressing > 0.0)
        return value


def at_rest(potentials: tuple[float, float], n: int) -> Converged:
    """The beginning, n nodes without load: the indenter just touches and has its electric and magnetic potential."""
    motion = np.zeros(N_MOTIONS)
    motion[COLUMNS["electric_potential"]], motion[COLUMNS["magnetic_potential"]] = potentials
    return Converged(motion, np.zeros(N_MOTIONS), np.zeros((n, 2)), np.zeros(n), None)


def held(start: Converged, prescribed: Controls) -> Controls:
    """The resultants that are prescribed, and every other motion held where it is."""
    return ramped({key: start.value(key) for key in MOTIONS}, start, prescribed)


def ramped(controls: Controls, start: Converged, given: Controls, fraction: float = 1.0) -> Controls:
    """The controls with those of a step instead, after a fraction of the linear way from its start to what is given."""
    taken = [COLUMNS[key] for key in given]
    others = {key: value for key, value in controls.items() if COLUMNS[key] not in taken}
    return others | {key: (1.0 - fraction) * start.value(key) + fraction * value for key, value in given.items()}


def extrapolate(law: ContactLaw, before: Converged, here: Converged) -> ContactState | None:
    """Predict the state after another increment of the same size as the last one, as an initial guess for solvers.

    Parameters
    ----------
    law
        Contact law, which makes the predicted tractions admissible.
    before, here
        Converged states at the beginning and at the end of the last increment.

    Returns
    -------
    Linear continuation of loads and free motions; None if one of the states is the undeformed body.
    """
    if before.state is None or here.state is None:
        return None
    load = 2.0 * here.state.load - before.state.load
    load[:, MECHANICAL] = law.project(load[:, MECHANICAL])
    return replace(here.state, load=load)
