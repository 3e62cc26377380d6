"""Contract of reduced systems: the interface between discretisation and contact."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from meeframe.fields import Array
from meeframe.mesh.regular import Cells

C = TypeVar("C")

Progress = Callable[[str, float], None]
"""A function that is called with the name of a stage and the fraction of it that is done."""


def silent(_stage: str, _fraction: float) -> None:
    """Report no progress; the default of arguments of the type `Progress`."""


@dataclass(frozen=True, eq=False)
class NodalFields:
    """Fields on the boundary in SI units and global axes, for output and checks.

    Attributes
    ----------
    points : Array
        (p, 3) [m]; points are repeated where tractions are discontinuous.
    cells : Cells
        Pairs of a meshio cell type and its connectivity, numbers into `points`.
    values : Array
        (p, f) extended displacement.
    fluxes : Array
        (p, f) extended traction on the outward normal.
    """

    points: Array
    cells: Cells
    values: Array
    fluxes: Array


@dataclass(frozen=True, eq=False)
class ReducedSystem(ABC):
    """A body condensed to the n nodes of its contact zone: displacement = offset + compliance(load).

    With f fields, a load (n, f) = (t.e1, t.e2, t.nu, q, s, ...) holds extended tractions as densities: t.nu <= 0 in
    compression, q = D.nu and s = B.nu outward, then the fluxes of further scalar fields. A displacement (n, f) is
    (u.e1, u.e2, u.nu, -phi, -psi, ...). Potentials are negated here, once, so that the compliance has a
    positive-definite symmetric part (docs/explanation/theory.md, Flipped rows). SI units, in the local frames of the
    nodes.

    Subclasses implement the four abstract methods. What they can do faster they say by inheriting capabilities
    (`meeframe.system.capabilities`).

    Attributes
    ----------
    points : Array
        (n, 3) node coordinates [m].
    frames : Array
        (n, 3, 3) local frames, rows e1, e2, nu, right-handed, nu outward.
    weights : Array
        (n,) integration weights [m^2]: the resultant of nodal densities is sum(weights * densities).
    cells : Cells
        Pairs of a meshio cell type and its connectivity, numbers into `points`.
    offset : Array
        (n, f) displacement at zero load, due to the prescribed boundary data.
    """

    points: Array
    frames: Array
    weights: Array
    cells: Cells
    offset: Array

    @property
    def n_fields(self) -> int:
        """Number of fields: three displacements and the potentials."""
        return int(self.offset.shape[1])

    @abstractmethod
    def apply(self, load: Array) -> Array:
        """Return the displacement due to a load, without the offset.

        Parameters
        ----------
        load : Array
            (n, fields) load, which must not be changed.

        Returns
        -------
        Array
            Compliance(load), (n, fields).
        """

    @abstractmethod
    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its own load.

        Returns
        -------
        Array
            Diagonal blocks of the compliance, (n, fields, fields).
        """

    @abstractmethod
    def dense(self) -> Array | None:
        """Return the compliance if it is stored as a matrix.

        Returns
        -------
        Array or None
            (n, fields, n, fields), response (node, field) to a load (node, field).
        """

    @abstractmethod
    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the whole boundary.

        Parameters
        ----------
        load : Array
            (n, fields) load on the contact zone.

        Returns
        -------
        NodalFields
            Extended displacements and tractions in SI units and global axes.
        """

    def capability(self, kind: type[C]) -> C | None:
        """Return an object with the methods of a capability; None if the system does not have it.

        By default a system has the capabilities that its class inherits. Override this method where a capability
        depends on the instance.

        Parameters
        ----------
        kind : type
            Class of the capability, for example `Multigrid`.

        Returns
        -------
        object or None
            An object of this class.
        """
        return self if isinstance(self, kind) else None
