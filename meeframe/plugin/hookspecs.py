"""Hook specifications: one documented hook per kind of thing that can be registered."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

import pluggy

from meeframe.contact.problem import Solver
from meeframe.elements.base import SurfaceElement
from meeframe.formulations.base import Formulation
from meeframe.greens.base import FundamentalSolution
from meeframe.indenters.base import Indenter
from meeframe.laws.base import ConductivityLaw, ContactLaw

PROJECT = "meeframe"
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)

T_co = TypeVar("T_co", covariant=True)


@dataclass(frozen=True)
class Record(Generic[T_co]):
    """One registered thing.

    name: as written in case files, in small letters, digits and hyphens; factory: a frozen dataclass (its fields are
    the case file's keys) or, for elements, the element class; summary: one line; source: equation, paper or book.
    """

    name: str
    factory: Callable[..., T_co]
    summary: str
    source: str


class HookSpecs:
    """The hooks. An implementation returns a list of records; see docs/plugins.md."""

    @hookspec
    def meeframe_fundamental_solutions(self) -> Iterable[Record[FundamentalSolution]]:  # type: ignore[empty-body]
        """Return the fundamental solutions (contract: meeframe.greens.base)."""

    @hookspec
    def meeframe_elements(self) -> Iterable[Record[SurfaceElement]]:  # type: ignore[empty-body]
        """Return the surface elements (contract: meeframe.elements.base)."""

    @hookspec
    def meeframe_formulations(self) -> Iterable[Record[Formulation]]:  # type: ignore[empty-body]
        """Return the formulations (contract: meeframe.system.reduced)."""

    @hookspec
    def meeframe_contact_laws(self) -> Iterable[Record[ContactLaw]]:  # type: ignore[empty-body]
        """Return the normal and tangential contact laws (contract: meeframe.laws.base)."""

    @hookspec
    def meeframe_conductivity_laws(self) -> Iterable[Record[ConductivityLaw]]:  # type: ignore[empty-body]
        """Return the electric and magnetic conductivity laws (contract: meeframe.laws.base)."""

    @hookspec
    def meeframe_solvers(self) -> Iterable[Record[Solver]]:  # type: ignore[empty-body]
        """Return the contact solvers (contract: meeframe.contact.problem)."""

    @hookspec
    def meeframe_indenters(self) -> Iterable[Record[Indenter]]:  # type: ignore[empty-body]
        """Return the indenter shapes (contract: meeframe.indenters.base)."""
