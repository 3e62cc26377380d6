"""Uzawa's method: gradient steps on the gap, projected by the contact law (eqs. 30-32)."""

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Final, Literal, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.contact.free_motion import start_load, start_motion
from meeframe.contact.generated_heat import check_no_generated_heat
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.fields.units import Quantity
from meeframe.solvers.conduction.elimination import Conductors
from meeframe.solvers.gradient.steps import Conduction, GradientStepper, Spectrum

STEP_FRACTION: Final = 1.6
"""Automatic step times the largest eigenvalue; the limit of stability is 2."""
MAX_STREAK: Final = 10
"""Number of successive increases of the change after which the automatic step is shortened."""
SHORTENING_FACTOR: Final = 0.7

_STEP = Quantity("Pa/m", gt=0, lt=float("inf"))


@dataclass(frozen=True, eq=False)
class _Memory:
    """State between steps.

    stepper, conduction: see their classes; conductors, spectrum: of the last step; damping: of the automatic step, 1 at
    first; change, streak: last relative change of the tractions and the number of its successive increases.
    """

    stepper: GradientStepper
    conduction: Conduction
    conductors: Conductors | None = None
    spectrum: Spectrum | None = None
    damping: float = 1.0
    change: float = np.inf
    streak: int = 0


@final
@checked_arguments
@dataclass(frozen=True)
class Uzawa(Solver):
    """Uzawa's method with the paper's fixed step or an automatic one.

    Gaps are those of u^(n+1), from p^(n) (docs/explanation/theory.md, Departures). A node that opens and closes
    repeatedly because it conducts in contact only is treated as biactive (meeframe.contact.conduction).

    Parameters
    ----------
    step_normal, step_tangential : float or 'auto', optional
        Steps r_nu and r_tau of eqs. (31), (32) [Pa/m]. The paper's r_nu = 5e3 is in GPa/m: 5e12 Pa/m. In eq. (32) r_tau
        is multiplied by M^2, here by M^2 / max(mu)^2, so that step_tangential is r_tau max(mu)^2. 'auto' is 1.6 over
        the largest eigenvalue of the compliance on the nodes in contact, potentials eliminated, in the metric of the
        contact law; it follows the contact as that grows and conducts, and is shortened if the tractions diverge.

    Raises
    ------
    CaseError
        If a step is not positive.
    """

    check_interval: ClassVar[int] = 10

    step_normal: Annotated[float, _STEP] | Literal["auto"] = "auto"
    step_tangential: Annotated[float, _STEP] | Literal["auto"] = "auto"

    def __post_init__(self) -> None:
        for name in ("step_normal", "step_tangential"):
            value: Any = getattr(self, name)
            if value != "auto":
                try:
                    object.__setattr__(self, name, _STEP.check(value))
                except ValueError as error:
                    raise CaseError(f"Uzawa: {name} = {value!r}: {error}, or 'auto'") from None

    def check(self, problem: ContactProblem) -> None:
        """Raise CaseError if friction or a current heats the body."""
        check_no_generated_heat(problem, "uzawa")

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the converged state of the previous load step, or no load at all."""
        n = len(problem.gap)
        conduction = Conduction.of(start, n)
        memory = _Memory(GradientStepper.of(problem), conduction)
        return Iterate(start_load(problem, start), conduction.contact_fraction, memory, start_motion(problem, start))

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Apply eq. (30) for the displacement, then eqs. (31), (32) for the tractions."""
        memory, traction = iterate.memory_as(_Memory), iterate.load[:, MECHANICAL]
        stepper = memory.stepper
        conduction, conductors = stepper.conductors(iterate, memory.conduction, memory.conductors)
        slope = stepper.slope(traction, conductors, iterate.load[:, POTENTIALS], iterate.motion)
        memory = replace(memory, conductors=conductors)
        if "auto" in (self.step_normal, self.step_tangential):
            touching = stepper.touching(traction, slope.gap)
            memory = replace(memory, spectrum=stepper.spectrum(touching, conductors, memory.spectrum))
        next_iterate, conduction = stepper.take_step(traction, traction, slope, self._steps(memory), conduction)
        memory = _monitor_change(replace(memory, conduction=conduction), next_iterate.load[:, MECHANICAL] - traction)
        return replace(next_iterate, memory=memory)

    def _steps(self, memory: _Memory) -> tuple[float, float]:
        auto = STEP_FRACTION * memory.damping / memory.stepper.largest(memory.spectrum)
        normal = auto if self.step_normal == "auto" else float(self.step_normal)
        tangential = auto if self.step_tangential == "auto" else float(self.step_tangential)
        return normal, tangential


def _monitor_change(memory: _Memory, change: Array) -> _Memory:
    """Return the state after a change (n, 3) of the tractions.

    A change that grows at many successive steps means that the step is too long.
    """
    size = float(np.abs(change).max(initial=0.0)) / memory.stepper.scales.pressure
    streak = memory.streak + 1 if size > memory.change else 0
    if streak < MAX_STREAK:
        return replace(memory, change=size, streak=streak)
    return replace(memory, change=size, streak=0, damping=SHORTENING_FACTOR * memory.damping)
