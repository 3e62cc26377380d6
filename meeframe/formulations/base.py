"""Contract of formulations: each condenses a body to a reduced system on its contact zone."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from meeframe.mesh.body import Body
from meeframe.system.capabilities import AnyArray, Persistence
from meeframe.system.reduced import Progress, ReducedSystem, silent


@dataclass(frozen=True)
class Formulation(ABC):
    """A discretisation; the fields of a concrete class are its case-file keys."""

    @abstractmethod
    def check(self, body: Body) -> None:
        """Raise MeshError or CaseError if the body does not fit the formulation, before anything is computed."""

    def warnings(self, body: Body) -> tuple[str, ...]:
        """Return warnings, as texts, about a body that `check` accepts but that may be computed inaccurately."""
        return ()

    def is_periodic(self) -> bool:
        """Return True if the contact zone is one period of an infinite surface, whose contact has no outer edge."""
        return False

    def resolves_edges(self) -> bool:
        """Return True if its reduced systems have the capability `EdgeResolution`."""
        return False

    @abstractmethod
    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Discretise the body, factorise once and condense to the contact zone.

        Raises
        ------
        MeshError, CaseError
            As `check`.
        MaterialError
            If the formulation does not accept the material.
        """


@dataclass(frozen=True)
class PersistentFormulation(Formulation):
    """A formulation that makes its systems again from the arrays of `Persistence.to_arrays`, for caches on disk."""

    @abstractmethod
    def from_arrays(self, body: Body, arrays: Mapping[str, AnyArray]) -> ReducedSystem:
        """Return the reduced system that was stored as arrays, bit for bit the same for contact.

        Fields on the whole boundary may need another reduction, at the first call of `recover`.

        Raises
        ------
        ValueError
            If these are not the arrays of such a system.
        """


def stored_arrays(formulation: Formulation, system: ReducedSystem) -> Mapping[str, AnyArray] | None:
    """Return the arrays from which a formulation makes a system again; None if it cannot.

    A formulation that wraps another one may return its systems without being able to make them again.
    """
    persistence = system.capability(Persistence)
    if persistence is None or not isinstance(formulation, PersistentFormulation):
        return None
    return persistence.to_arrays()
