"""Uzawa's method: gradient steps on the gap, projected by the contact law (eqs. 30-32)."""

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Final, Literal, final

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, Iterate, Solver, augmented_traction, contact_gap
from meeframe.core.errors import CaseError
from meeframe.core.fields import MECHANICAL, Array
from meeframe.core.quantities import Quantity
from meeframe.solvers.conduction import Switches, own_response, resistances
from meeframe.solvers.elimination import Conductors, Elimination, eliminate
from meeframe.solvers.scales import Scales, problem_scales
from meeframe.solvers.spectrum import Spectrum, contact_exposure, largest_eigenvalue

STEP_FRACTION: Final = 1.6
"""The automatic step times the largest eigenvalue; the limit of stability is 2."""
STREAK: Final = 10
"""So many times in succession may the change grow before the automatic step is shortened."""
SHORTENING: Final = 0.7

_STEP = Quantity("Pa/m", gt=0, lt=float("inf"))


@dataclass(frozen=True, eq=False)
class _Memory:
    """elimination, own, scales: see there, fixed; conductors, spectrum, switches: of the last step; damping: of the
    automatic step, 1 at first; change, streak: last relative change of the tractions and how many times in succession
    it has grown."""

    elimination: Elimination
    own: Array
    scales: Scales
    conductors: Conductors | None
    spectrum: Spectrum | None
    switches: Switches
    damping: float = 1.0
    change: float = np.inf
    streak: int = 0


@final
@dataclass(frozen=True)
class Uzawa(Solver):
    """Uzawa's method with the paper's fixed step or an automatic one.

    step_normal, step_tangential: r_nu and r_tau of eqs. (31), (32) [Pa/m], or 'auto'. The paper's r_nu = 5e3 is in
    GPa/m: 5e12 Pa/m. In eq. (32) r_tau goes with M^2; here it goes with M^2 / max(mu)^2, so that it is r_tau max(mu)^2.
    'auto' is 1.6 over the largest eigenvalue of the compliance on the nodes in contact, potentials eliminated, in the
    metric of the contact law; it follows the contact as that grows and conducts, and is shortened if the tractions
    begin to run away.

    Gaps are those of u^(n+1), from p^(n) (notes, section 6). A node that keeps opening and closing because it conducts
    in contact only is brought to graze (meeframe.solvers.conduction). Raises CaseError for a step that is not positive.
    """

    stride: ClassVar[int] = 10

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

    def init(self, problem: ContactProblem, start: ContactState | None) -> Iterate:
        """The converged state of the previous load step, or no load at all."""
        n = len(problem.gap)
        memory = _Memory(
            elimination=eliminate(problem),
            own=own_response(problem),
            scales=problem_scales(problem),
            conductors=None,
            spectrum=None,
            switches=Switches.unused(n),
        )
        if start is None:
            return Iterate(np.zeros((n, 5)), np.zeros(n), memory)
        return Iterate(start.load, start.closed, memory)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Eq. (30) for the displacement, then eqs. (31), (32) for the tractions."""
        memory = _memory(iterate)
        traction = iterate.load[:, MECHANICAL]
        resistance = resistances(problem, traction[:, 2], iterate.closed, memory.own)
        conductors = memory.elimination.prepare(resistance, memory.conductors)
        flux, moved = memory.elimination.respond(traction, conductors, iterate.load[:, 3:] - conductors.flux)
        gap = contact_gap(problem, moved + conductors.displacement)
        memory = self._measured(replace(memory, conductors=conductors), problem, traction, gap)
        r_normal, r_tangential = self._steps(memory)
        trial = augmented_traction(problem.contact_law, traction, gap, r_normal, r_tangential)
        load = np.concatenate([problem.contact_law.project(trial), flux + conductors.flux], axis=1)
        switches = memory.switches.next(traction[:, 2] < 0.0, load[:, 2] < 0.0, trial[:, 2])
        closed = switches.closed(iterate.closed, load[:, 2] < 0.0, trial[:, 2], memory.scales.pressure)
        return Iterate(load, closed, _watched(replace(memory, switches=switches), load[:, MECHANICAL] - traction))

    def _measured(self, memory: _Memory, problem: ContactProblem, traction: Array, gap: Array) -> _Memory:
        """Memory with a spectrum that fits the contact, if an automatic step needs one."""
        if "auto" not in (self.step_normal, self.step_tangential) or memory.conductors is None:
            return memory
        touching = (traction[:, 2] < 0.0) | (gap[:, 2] < 0.0)
        if not touching.any():
            return memory
        exposure = contact_exposure(touching, memory.conductors.resistance, memory.scales)
        if memory.spectrum is not None and memory.spectrum.holds(exposure):
            return memory
        scaling = problem.contact_law.tangential_scaling()
        start = None if memory.spectrum is None else memory.spectrum.vector
        spectrum = largest_eigenvalue(memory.elimination, memory.conductors, exposure, scaling, start)
        return replace(memory, spectrum=spectrum)

    def _steps(self, memory: _Memory) -> tuple[float, float]:
        largest = memory.spectrum.largest if memory.spectrum is not None else memory.scales.normal_compliance
        auto = STEP_FRACTION * memory.damping / largest
        normal = auto if self.step_normal == "auto" else float(self.step_normal)
        tangential = auto if self.step_tangential == "auto" else float(self.step_tangential)
        return normal, tangential


def _memory(iterate: Iterate) -> _Memory:
    if not isinstance(iterate.memory, _Memory):
        raise TypeError("the iterate was not made by Uzawa.init")
    return iterate.memory


def _watched(memory: _Memory, change: Array) -> _Memory:
    """Memory after a change (n, 3) of the tractions: a change that grows and grows means that the step is too long."""
    size = float(np.abs(change).max(initial=0.0)) / memory.scales.pressure
    streak = memory.streak + 1 if size > memory.change else 0
    if streak < STREAK:
        return replace(memory, change=size, streak=streak)
    return replace(memory, change=size, streak=0, damping=SHORTENING * memory.damping)
