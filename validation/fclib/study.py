"""Frictional cases of ours solved by Siconos, by way of files of FCLIB."""

import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from judge import SOLVERS, siconos_solves

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb
from meeframe.model.case import Case
from meeframe.model.load import case_from_tables
from meeframe.model.solve import reduce, solve_steps
from meeframe.results.fclib import LocalSolution, natural_residual, write_local
from meeframe.study.fclib import exchanged

HERE: Final = Path(__file__).parent
SAME: Final = 1e-9
"""Of the largest reaction or gap: a hundred times what either solver leaves of its own problem."""
SLIPS: Final = 1e-7
"""Of the largest gap: what slips less sticks."""


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
class Judged:
    """An increment by our solver and one of Siconos's.

    contacts: of the problem; pressed, slipping: by ours; reaction, gap: largest differences over the largest value;
    alike: both agree at every contact on open, stick and slip; ours, theirs: natural residuals of the reactions;
    iterations, seconds: of Siconos; converged: both say so.
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
        """Whether reactions, gaps and states agree and both converged."""
        return self.converged and self.alike and max(self.reaction, self.gap) <= SAME

    @property
    def regime(self) -> str:
        """What the contact does, by ours."""
        if self.slipping == 0:
            return "full stick"
        return "sliding" if self.slipping == self.pressed else "partial slip"


def load(name: str, divisions: int) -> Case:
    """A case file of this folder with another division of the contact zone."""
    text = (HERE / f"{name}.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    tables["mesh"]["divisions"] = divisions
    return case_from_tables(tables, folder=HERE, text=text)


def judged(bodies: tuple[Body, ...], solvers: tuple[str, ...] = SOLVERS) -> Iterator[Judged]:
    """Every increment of every case by each of the solvers. Raises RuntimeError if Siconos is not installed."""
    for body in bodies:
        case = load(body.name, body.divisions)
        system = reduce(case)
        for mu in body.coefficients:
            frictional = replace(case, contact_law=IsotropicCoulomb(mu))
            for step in solve_steps(frictional, system, boundary=False):
                local, solution = exchanged(frictional, system, step)
                with tempfile.TemporaryDirectory() as folder:
                    path = Path(folder) / "problem.hdf5"
                    write_local(path, local)
                    ours = natural_residual(local, solution.r)
                    for solver in solvers:
                        found = siconos_solves(path, solver)
                        state, their_state = _state(solution), _state(LocalSolution(found.u, found.r))
                        yield Judged(
                            body=body.name,
                            divisions=body.divisions,
                            mu=mu,
                            step=step.step,
                            solver=solver,
                            contacts=len(local.mu),
                            pressed=int((state > 0).sum()),
                            slipping=int((state == 2).sum()),
                            reaction=_difference(found.r, solution.r),
                            gap=_difference(found.u, solution.u),
                            alike=bool(np.array_equal(state, their_state)),
                            ours=ours,
                            theirs=natural_residual(local, found.r),
                            iterations=found.iterations,
                            seconds=found.seconds,
                            converged=found.converged and step.status == "converged",
                        )


def _difference(found: Array, ours: Array) -> float:
    return float(np.abs(found - ours).max() / np.abs(ours).max())


def _state(solution: LocalSolution) -> Array:
    """0 open, 1 stick, 2 slip at each contact, (m,)."""
    r, u = solution.r.reshape(-1, 3), solution.u.reshape(-1, 3)
    pressed = r[:, 0] > SAME * r[:, 0].max()
    slips = np.hypot(u[:, 1], u[:, 2]) > SLIPS * np.abs(u).max()
    return np.where(pressed, 1 + slips, 0)
