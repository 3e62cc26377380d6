"""Hook specifications, with one documented hook for each kind of object that can be registered."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import pluggy

from meeframe.contact.problem import Solver
from meeframe.elements.base import SurfaceElement
from meeframe.formulations.base import Formulation
from meeframe.greens.base import FundamentalSolution
from meeframe.indenters.base import Indenter
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.laws.wear import WearLaw

PROJECT = "meeframe"
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)
"""Decorator of the functions of a plugin that implement hooks of `HookSpecs`."""

T_co = TypeVar("T_co", covariant=True)


@dataclass(frozen=True)
class Record(Generic[T_co]):
    """One registered object.

    Attributes
    ----------
    name : str
        Name in case files, in lower-case letters, digits and hyphens.
    factory : callable
        A frozen dataclass whose fields are the keys in case files or, for elements, the element class.
    summary : str
        Description in one line.
    source : str
        Equation, paper or book.
    check_arguments : callable or None
        A function that returns, for an object of the factory, further arguments by name of the conformance kit with
        which `meeframe plugins check` checks it, such as the body and the exact field of a formulation.
    """

    name: str
    factory: Callable[..., T_co]
    summary: str
    source: str
    check_arguments: Callable[[Any], Mapping[str, Any]] | None = None


class HookSpecs:
    """Hooks of meeframe, one for each kind of object.

    An implementation is a function of the same name, without arguments, decorated with `hookimpl`. It returns a list of
    records (`Record`) whose factories make objects of the abstract class that the hook names; see
    docs/howto/plugins.md.
    """

    @hookspec
    def meeframe_fundamental_solutions(self) -> Iterable[Record[FundamentalSolution]]:  # type: ignore[empty-body]
        """Return fundamental solutions (abstract class: meeframe.greens.base)."""

    @hookspec
    def meeframe_elements(self) -> Iterable[Record[SurfaceElement]]:  # type: ignore[empty-body]
        """Return surface elements (abstract class: meeframe.elements.base)."""

    @hookspec
    def meeframe_formulations(self) -> Iterable[Record[Formulation]]:  # type: ignore[empty-body]
        """Return formulations (abstract class: meeframe.formulations.base)."""

    @hookspec
    def meeframe_contact_laws(self) -> Iterable[Record[ContactLaw]]:  # type: ignore[empty-body]
        """Return normal and tangential contact laws (abstract class: meeframe.laws.base)."""

    @hookspec
    def meeframe_conductivity_laws(self) -> Iterable[Record[ConductivityLaw]]:  # type: ignore[empty-body]
        """Return conductivity laws, of fluxes through the interface (abstract class: meeframe.laws.base)."""

    @hookspec
    def meeframe_wear_laws(self) -> Iterable[Record[WearLaw]]:  # type: ignore[empty-body]
        """Return wear laws (abstract class: meeframe.laws.wear)."""

    @hookspec
    def meeframe_solvers(self) -> Iterable[Record[Solver]]:  # type: ignore[empty-body]
        """Return contact solvers (abstract class: meeframe.contact.problem)."""

    @hookspec
    def meeframe_indenters(self) -> Iterable[Record[Indenter]]:  # type: ignore[empty-body]
        """Return indenter shapes (abstract class: meeframe.indenters.base)."""
