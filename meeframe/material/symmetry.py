"""Symmetry classes of materials: their independent, equal and dependent components."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from meeframe.common.errors import MaterialError

Component = tuple[str, int, int]
"""Symbol and two 1-based indices: two Voigt indices for c; field and Voigt for e and q; one and zero for the vectors p
and m; plain for the others."""

SYMBOLS: Final = ("c", "e", "q", "eps", "lambda", "mu", "alpha", "beta", "k", "p", "m")
"""Symbols of the components; those of heat come last (meeframe.material.thermal)."""

Label = Callable[[Component], str]

_TOLERANCE: Final = 1e-9  # relative; equal components may differ by the rounding of a unit conversion


@dataclass(frozen=True)
class SymmetryClass:
    """Components of one symmetry class, in the frame of its axes.

    Attributes
    ----------
    name : str
        Name of the class in case files.
    elastic, coupling, second_order, polar : tuple of str
        Groups of equal components of c; of e and q; of tensors of second order; of vectors. A group is a text of Voigt
        or plain indices such as '11 22'.
    shear : str
        Elastic component that equals (c_11 - c_12)/2, if any.
    complete_tables : bool
        True if every independent component of c, eps and mu is required, false if absent components are zero.
    """

    name: str
    elastic: tuple[str, ...]
    coupling: tuple[str, ...]
    second_order: tuple[str, ...]
    polar: tuple[str, ...] = ()
    shear: str | None = None
    complete_tables: bool = True

    def complete(self, components: dict[Component, float], label: Label) -> dict[Component, float]:
        """Return all components that are not zero, from the independent ones.

        Parameters
        ----------
        components : dict of Component to float
            Values by component. Dependent components may be among them if they agree.
        label : callable
            Function that returns the name of a component, for messages.

        Raises
        ------
        MaterialError
            If components contradict the class, do not exist in it, or are missing.
        """
        values = {component: value for component, value in components.items() if value != 0.0}
        existing = {component for group in self._groups() for component in group}
        for component in values:
            if component not in existing:
                raise MaterialError(
                    f"{label(component)} does not exist in symmetry {self.name!r}, must be zero or absent"
                )
        for group in self._groups():
            self._tie(group, components, values, label)
        if self.shear is not None:
            self._relate(values, label)
        required = [group[0] for group in self._groups() if group[0][0] in ("c", "eps", "mu")]
        missing = [label(component) for component in required if component not in values]
        if missing and self.complete_tables:
            raise MaterialError(f"symmetry {self.name!r} needs {', '.join(missing)}")
        return values

    def _groups(self) -> Iterator[tuple[Component, ...]]:
        groups = {"c": self.elastic, **dict.fromkeys("eq", self.coupling), **dict.fromkeys("pm", self.polar)}
        for symbol in SYMBOLS:
            for text in groups.get(symbol, self.second_order):
                yield tuple(_component(symbol, pair) for pair in text.split())

    def _tie(
        self,
        group: tuple[Component, ...],
        components: dict[Component, float],
        values: dict[Component, float],
        label: Label,
    ) -> None:
        present = [component for component in group if component in components]
        if not present:
            return
        first = present[0]
        for other in present[1:]:
            if abs(components[other] - components[first]) > _TOLERANCE * abs(components[first]):
                raise MaterialError(
                    f"{label(first)} = {components[first]:g} and {label(other)} = {components[other]:g} must be equal "
                    f"in symmetry {self.name!r}"
                )
        values.update(dict.fromkeys(group, components[first]))

    def _relate(self, values: dict[Component, float], label: Label) -> None:
        """Compute the missing one of c_11, c_12 and the shear stiffness, or check them if none is missing."""
        groups = {group[0]: group for group in self._groups() if group[0][0] == "c"}
        tied = {member: group for group in groups.values() for member in group}
        axial, cross, shear = ("c", 1, 1), ("c", 1, 2), _component("c", self.shear or "")
        unknown = [component for component in (axial, cross, shear) if component not in values]
        if len(unknown) > 1:
            return
        if not unknown:
            expected = (values[axial] - values[cross]) / 2.0
            if abs(values[shear] - expected) > _TOLERANCE * values[axial]:
                raise MaterialError(
                    f"{label(shear)} = {values[shear]:g} must be (c_1111 - c_1122)/2 = {expected:g} in symmetry "
                    f"{self.name!r}"
                )
            return
        solved = {
            shear: lambda: (values[axial] - values[cross]) / 2.0,
            cross: lambda: values[axial] - 2.0 * values[shear],
            axial: lambda: values[cross] + 2.0 * values[shear],
        }[unknown[0]]()
        values.update(dict.fromkeys(tied[unknown[0]], solved))


def _index_pairs(rows: int, columns: int, symmetric: bool) -> tuple[str, ...]:
    return tuple(f"{i}{j}" for i in range(1, rows + 1) for j in range(1, columns + 1) if i <= j or not symmetric)


_CLASSES: Final = (
    SymmetryClass(
        "triclinic",
        _index_pairs(6, 6, True),
        _index_pairs(3, 6, False),
        _index_pairs(3, 3, True),
        ("1", "2", "3"),
        complete_tables=False,
    ),
    SymmetryClass(
        "orthotropic",
        ("11", "12", "13", "22", "23", "33", "44", "55", "66"),
        ("15", "24", "31", "32", "33"),
        ("11", "22", "33"),
        ("3",),
    ),
    SymmetryClass(
        "transversely-isotropic",
        ("11 22", "12", "13 23", "33", "44 55", "66"),
        ("15 24", "31 32", "33"),
        ("11 22", "33"),
        ("3",),
        shear="66",
    ),
    SymmetryClass("cubic", ("11 22 33", "12 13 23", "44 55 66"), ("14 25 36",), ("11 22 33",)),
    SymmetryClass("isotropic", ("11 22 33", "12 13 23", "44 55 66"), (), ("11 22 33",), shear="44"),
)


def symmetry_class(name: str) -> SymmetryClass:
    """Return a symmetry class by name.

    Raises
    ------
    MaterialError
        For an unknown name; the message lists the names that exist.
    """
    for candidate in _CLASSES:
        if candidate.name == name:
            return candidate
    raise MaterialError(f"unknown symmetry {name!r}; allowed: {', '.join(each.name for each in _CLASSES)}")


def _component(symbol: str, pair: str) -> Component:
    return symbol, int(pair[0]), int(pair[1:] or 0)
