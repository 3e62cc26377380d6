"""Solve frictional cases of meeframe with Siconos, through FCLIB files."""

import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from siconos_reference import SOLVERS, siconos_solves

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb
from meeframe.model.case import Case
from meeframe.model.load import case_from_tables
from meeframe.model.solve import reduce, solve_steps
from meeframe.results.fclib import LocalSolution, natural_residual, write_local
from meeframe.study.fclib import exchange_increment

HERE: Final = Path(__file__).parent
SAME: Final = 1e-9
"""Tolerance relative to the largest reaction or gap: a hundred times the errors of both solvers."""
SLIPS: Final = 1e-7
"""Smallest slip of a slipping contact, relative to the largest gap."""


@dataclass(frozen=True)
class Body:
    """A case file, the divisions of its contact zone and the friction coefficients to solve it with."""

    name: str
    divisions: int
    coefficients: tuple[float, ...]


QUICK: Final = (Body("sphere", 8, (0.3,)), Body("stick", 6, (0.6,)), Body("mee", 6, (0.3,)))
FULL: Final = (
    *(Body("sphere", divisions, (0.3, 0.6)) for divisions in (8, 12, 16, 24)),
    *(Body("stick", divisions, (0.6, 10.0)) for divisions in (8, 16)),
    *(Body("mee", divisions, (0.3, 0.6)) for divisions in (8, 12)),
)


@dataclass(frozen=True)
class Comparison:
    """Comparison of an increment by meeframe and by one solver of Siconos.

    contacts: number of contacts; pressed, slipping: numbers of closed and slipping contacts by meeframe; reaction, gap:
    largest differences relative to the largest value; alike: True if every contact has the same state (open, stick,
    slip); ours, theirs: natural residuals of the reactions; iterations, seconds: of Siconos; converged: True if both
    converged.
    """

    body: str
    divisions: int
    mu: float
    step: int
    solver: str
    contacts: int
    pressed: int
    slipping: int
    reaction: float
    gap: float
    alike: bool
    ours: float
    theirs: float
    iterations: int
    seconds: float
    converged: bool

    @property
    def agrees(self) -> bool:
        """True if reactions, gaps and states agree and both solvers converged."""
        return self.converged and self.alike and max(self.reaction, self.gap) <= SAME

    @property
    def regime(self) -> str:
        """Slip regime, by meeframe."""
        if self.slipping == 0:
            return "full stick"
        return "sliding" if self.slipping == self.pressed else "partial slip"


def load(name: str, divisions: int) -> Case:
    """Load a case file of this folder with another division of the contact zone."""
    text = (HERE / f"{name}.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    tables["mesh"]["divisions"] = divisions
    return case_from_tables(tables, folder=HERE, text=text)


def compare(bodies: tuple[Body, ...], solvers: tuple[str, ...] = SOLVERS) -> Iterator[Comparison]:
    """Compare every increment of every case, by each solver. Raises RuntimeError if Siconos is not installed."""
    for body in bodies:
        case = load(body.name, body.divisions)
        system = reduce(case)
        for mu in body.coefficients:
            frictional = replace(case, contact_law=IsotropicCoulomb(mu))
            for step in solve_steps(frictional, system, boundary=False):
                local, solution = exchange_increment(frictional, system, step)
                with tempfile.TemporaryDirectory() as folder:
                    path = Path(folder) / "problem.hdf5"
                    write_local(path, local)
                    ours = natural_residual(local, solution.r)
                    for solver in solvers:
                        result = siconos_solves(path, solver)
                        state, their_state = _state(solution), _state(LocalSolution(result.u, result.r))
                        yield Comparison(
                            body=body.name,
                            divisions=body.divisions,
                            mu=mu,
                            step=step.step,
                            solver=solver,
                            contacts=len(local.mu),
                            pressed=int((state > 0).sum()),
                            slipping=int((state == 2).sum()),
                            reaction=_difference(result.r, solution.r),
                            gap=_difference(result.u, solution.u),
                            alike=bool(np.array_equal(state, their_state)),
                            ours=ours,
                            theirs=natural_residual(local, result.r),
                            iterations=result.iterations,
                            seconds=result.seconds,
                            converged=result.converged and step.status == "converged",
                        )


def _difference(result: Array, ours: Array) -> float:
    return float(np.abs(result - ours).max() / np.abs(ours).max())


def _state(solution: LocalSolution) -> Array:
    """Return 0 (open), 1 (stick) or 2 (slip) for each contact, (m,)."""
    r, u = solution.r.reshape(-1, 3), solution.u.reshape(-1, 3)
    pressed = r[:, 0] > SAME * r[:, 0].max()
    slips = np.hypot(u[:, 1], u[:, 2]) > SLIPS * np.abs(u).max()
    return np.where(pressed, 1 + slips, 0)
