"""Contract of formulations: each condenses a body to a reduced system on its contact zone."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from meeframe.common.errors import CaseError
from meeframe.mesh.body import Body, check_layers
from meeframe.system.capabilities import AnyArray, Persistence
from meeframe.system.reduced import Progress, ReducedSystem, silent


@dataclass(frozen=True)
class Formulation(ABC):
    """A discretisation; the fields of a concrete class are its case-file keys."""

    @abstractmethod
    def check(self, body: Body) -> None:
        """Check a body before anything is computed.

        Parameters
        ----------
        body : Body
            The body.

        Raises
        ------
        MeshError, CaseError
            If the body does not fit the formulation.
        """

    def warnings(self, body: Body) -> tuple[str, ...]:
        """Return warnings about a body that `check` accepts but that may be computed inaccurately.

        Parameters
        ----------
        body : Body
            The body.

        Returns
        -------
        tuple of str
            The warnings.
        """
        return ()

    def is_periodic(self) -> bool:
        """Return True if the contact zone is one period of an infinite surface, whose contact has no outer edge."""
        return False

    def resolves_edges(self) -> bool:
        """Return True if its reduced systems have the capability `EdgeResolution`."""
        return False

    def undetermined_levels(self, body: Body) -> tuple[int, ...]:
        """Return the fields whose level heat flow leaves undetermined in an infinite body.

        Parameters
        ----------
        body : Body
            The body.

        Returns
        -------
        tuple of int
            Their columns in local frames, in which 2 is the normal displacement.
        """
        return ()

    def supports_layers(self) -> bool:
        """Return True if it takes the layers of a body into account; other bodies with layers are refused."""
        return False

    def supports_rolling(self) -> bool:
        """Return True if the material may move through the contact zone: its compliance is the same along a grid."""
        return False

    def couples_heat(self) -> bool:
        """Return True if the temperature of a body may act on its other fields; other such bodies are refused."""
        return False

    @abstractmethod
    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Discretise the body, factorise once and condense to the contact zone.

        Parameters
        ----------
        body : Body
            The body.
        progress : callable, optional
            Function that is called with the name of a stage and the fraction of it that is done.

        Returns
        -------
        ReducedSystem
            The body condensed to its contact zone.

        Raises
        ------
        MeshError, CaseError
            As `check`.
        MaterialError
            If the formulation does not accept the material.
        """


@dataclass(frozen=True)
class PersistentFormulation(Formulation):
    """Formulation that restores its systems from the arrays of `Persistence.to_arrays`, for caches on disk."""

    @abstractmethod
    def from_arrays(self, body: Body, arrays: Mapping[str, AnyArray]) -> ReducedSystem:
        """Restore a reduced system that was stored as arrays.

        For contact it is bitwise equal to the original. Fields on the whole boundary may need another reduction, at the
        first call of `recover`.

        Parameters
        ----------
        body : Body
            The body that was reduced.
        arrays : dict of str to array
            Arrays of `Persistence.to_arrays`.

        Returns
        -------
        ReducedSystem
            The system.

        Raises
        ------
        ValueError
            If these are not the arrays of such a system.
        """


def check_layered(formulation: Formulation, body: Body) -> None:
    """Check the layers of a body, before `Formulation.check`.

    Parameters
    ----------
    formulation : Formulation
        The formulation.
    body : Body
        The body.

    Raises
    ------
    CaseError
        If the body has layers or a rigid base that the formulation does not support, or that do not fit the body.
    """
    if not body.layers:
        return
    if not formulation.supports_layers():
        raise CaseError(
            f"formulation {type(formulation).__name__} does not support layers or a rigid base; allowed: formulations "
            "that do, such as half-space, or dense-bem and skfem for blocks and for half spaces on a rigid base"
        )
    check_layers(body)


def check_body(formulation: Formulation, body: Body) -> None:
    """Check the layers and the thermal expansion of a body, before `Formulation.check`.

    Parameters
    ----------
    formulation : Formulation
        The formulation.
    body : Body
        The body.

    Raises
    ------
    CaseError
        As `check_layered`, or if the formulation ignores that heat acts on other fields of the body or its layers.
    """
    check_layered(formulation, body)
    if not body.expands:
        return
    if not formulation.couples_heat():
        raise CaseError(
            f"the formulation {type(formulation).__name__} does not support thermal expansion, pyroelectric and "
            "pyromagnetic coefficients; allowed: a material with thermal_conductivity alone, or the formulation "
            "half-space, dense-bem, hmatrix-bem or skfem"
        )


def stored_arrays(formulation: Formulation, system: ReducedSystem) -> Mapping[str, AnyArray] | None:
    """Return the arrays from which a formulation makes a system again.

    Parameters
    ----------
    formulation : Formulation
        The formulation.
    system : ReducedSystem
        A system that it has returned.

    Returns
    -------
    dict of str to array or None
        Arrays of `Persistence.to_arrays`. None if the formulation cannot make the system again, as one that wraps
        another formulation may not be able to.
    """
    persistence = system.capability(Persistence)
    if persistence is None or not isinstance(formulation, PersistentFormulation):
        return None
    return persistence.to_arrays()
