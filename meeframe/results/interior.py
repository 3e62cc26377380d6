"""Fields inside a body: displacement, potentials, stress, flux densities, invariants and maxima, and VTU files."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, get_args

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError, ResultError
from meeframe.common.literal import LiteralTable
from meeframe.fields import ELECTRIC_FIELD, MAGNETIC_FIELD, MECHANICAL, MEE, POTENTIALS, Array, FieldSet, Indices
from meeframe.plugin.validation import choices
from meeframe.results.canvas import on_axes
from meeframe.results.output import replacing
from meeframe.results.plane import PlaneField, draw_plane, planes_figure
from meeframe.results.records import StepResult, Zone, split_load
from meeframe.system.reduced import Progress, ReducedSystem, silent
from meeframe.system.two_body import interior_of_second, required_interior

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Body = Literal["first", "second"]
"""One of two bodies in contact."""
BODIES: Final[tuple[Body, ...]] = get_args(Body)
_LABELS: Final = {
    "von_mises": "von Mises stress",
    "max_shear": "largest shear stress",
    "max_principal_stress": "largest principal stress",
}
_ALIGNED: Final = 1e-9
"""Largest difference of the axes of a grid from the global ones that counts as none."""
_BOX_POINTS: Final = (17, 17, 15)
"""Numbers of points of `PointGrid.below_contact` along e1, e2 and the normal."""
_BOX_WIDTH, _BOX_DEPTH = 1.5, 2.5
"""Half width and depth of that box, in half widths of the contact."""


class Maximum(NamedTuple):
    """The largest value of a quantity among some points, its SI unit and its position (3,) in global axes [m]."""

    name: str
    value: float
    unit: str
    position: Array


class ContactExtent(NamedTuple):
    """Place and size of a contact.

    Attributes
    ----------
    centre
        Position (3,) on the surface in the middle of the contact [m].
    frame
        Rows e1, e2 and the outward normal there, (3, 3).
    half_width
        Half of its largest width, at least two spacings [m].
    spacing
        Spacing of the nodes of the zone [m].
    """

    centre: Array
    frame: Array
    half_width: float
    spacing: float


def contact_extent(zone: Zone, step: StepResult) -> ContactExtent:
    """Return the place and size of the contact of an increment. Raises ResultError if no node is in contact."""
    touching = zone.points[step.touching]
    if not len(touching):
        raise ResultError(f"no node is in contact in step {step.step}, increment {step.increment}")
    centre = (touching.min(axis=0) + touching.max(axis=0)) / 2.0
    nearest = np.linalg.norm(zone.points - centre, axis=1).argmin()
    frame = zone.frames[nearest]
    spacing = float(np.sqrt(np.median(np.abs(zone.weights))))
    extent = np.ptp(touching @ frame[:2].T, axis=0).max()
    # the surface above the centre, which may be curved
    surface = centre + frame[2] * ((zone.points[nearest] - centre) @ frame[2])
    return ContactExtent(surface, frame, max(float(extent) / 2.0, 2.0 * spacing), spacing)


@checked_arguments
@dataclass(frozen=True, eq=False)
class PointGrid:
    """Points of a rectangular grid, such as a line, a plane section or a box.

    Attributes
    ----------
    origin : Array
        (3,) position of the coordinates zero [m].
    axes : Array
        (3, 3) unit vectors of the coordinates, in rows.
    coordinates : tuple of Array
        Increasing coordinates of the points along each axis [m]; a single one for the normal of a section.
    """

    origin: Array
    axes: Array
    coordinates: tuple[Array, Array, Array]

    @classmethod
    def along_global_axes(cls, x: Array | float, y: Array | float, z: Array | float) -> "PointGrid":
        """Return the grid of coordinates along the global axes.

        Parameters
        ----------
        x, y, z : Array or float
            Coordinates along each axis [m].

        Returns
        -------
        PointGrid
            The grid.
        """
        x, y, z = (np.atleast_1d(np.asarray(values, float)) for values in (x, y, z))
        return cls(np.zeros(3), np.eye(3), (x, y, z))

    @classmethod
    def below_contact(
        cls,
        zone: Zone,
        step: StepResult,
        body: Body = "first",
        interface_depths: Sequence[float] = (),
        thickness: float = math.inf,
    ) -> "PointGrid":
        """Return a box under the contact of an increment, from one nodal spacing below the surface downwards.

        In the second of two bodies, which lies on the first, the box is above the contact.

        It is 1.5 times as wide as the contact and 1.25 times as deep as the contact is wide; points are denser near the
        surface. In layered bodies it ends on a rigid base, and has points on all interfaces and in all layers above its
        lower side.

        Parameters
        ----------
        zone : Zone
            Contact zone.
        step : StepResult
            Increment.
        body : {'first', 'second'}, optional
            Body in which the points lie.
        interface_depths : sequence of float, optional
            Depths of the interfaces of its layers, from the surface down [m].
        thickness : float, optional
            Thickness of a body on a rigid base [m].

        Returns
        -------
        PointGrid
            The grid.

        Raises
        ------
        ResultError
            If no node is in contact.
        """
        surface, frame, half_width, spacing = contact_extent(zone, step)
        across = [_BOX_WIDTH * half_width * np.linspace(-1.0, 1.0, count) for count in _BOX_POINTS[:2]]
        fractions, bottom = np.linspace(0.0, 1.0, _BOX_POINTS[2]) ** 1.5, min(_BOX_DEPTH * half_width, thickness)
        top = min(spacing, bottom / 2.0)
        depths = top + fractions * (bottom - top)
        inside = [depth for depth in interface_depths if depth < bottom]
        for upper, lower in pairwise([0.0, *inside, bottom]):
            if not ((depths > upper) & (depths < lower)).any():
                depths = np.append(depths, (upper + lower) / 2.0)
        depths = np.union1d(depths, inside)
        return cls(surface, frame, (across[0], across[1], depths if body == "second" else -depths[::-1]))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of points along the axes."""
        x, y, z = self.coordinates
        return len(x), len(y), len(z)

    @property
    def points(self) -> Array:
        """Positions (m, 3) in global axes [m], the last coordinate changing fastest."""
        local = np.stack(np.meshgrid(*self.coordinates, indexing="ij"), axis=-1).reshape(-1, 3)
        points: Array = self.origin + local @ self.axes
        return points

    def labelled(self) -> tuple[tuple[str, str, str], list[Array]]:
        """Return names of the axes and coordinates along them [m]: x, y and z if they are the global ones."""
        if np.abs(self.axes - np.eye(3)).max() < _ALIGNED:
            return ("x", "y", "z"), [
                start + values for start, values in zip(self.origin, self.coordinates, strict=True)
            ]
        return ("along e1", "along e2", "along the normal"), list(self.coordinates)

    def cells(self) -> tuple[str, Indices]:
        """Return the cells between the points, as meshio's cell type and connectivity."""
        numbers = np.arange(np.prod(self.shape)).reshape(self.shape)
        wide = [axis for axis, count in enumerate(self.shape) if count > 1]
        names = {0: "vertex", 1: "line", 2: "quad", 3: "hexahedron"}
        corners = {
            0: ((),),
            1: ((0,), (1,)),
            2: ((0, 0), (1, 0), (1, 1), (0, 1)),
            3: ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
        }[len(wide)]
        nodes = []
        for corner in corners:
            index = [slice(None)] * 3
            for axis, end in zip(wide, corner, strict=True):
                index[axis] = slice(1, None) if end else slice(None, -1)
            nodes.append(numbers[tuple(index)].ravel())
        return names[len(wide)], np.stack(nodes, axis=1)


@dataclass(frozen=True, eq=False)
class InteriorResult:
    """Fields at m points inside a body, in SI units and global axes.

    Attributes
    ----------
    points
        (m, 3) [m].
    displacement
        (m, 3) [m].
    potentials
        (m, scalars): electric [V], magnetic [A], and those of further fields.
    strain
        (m, 3, 3).
    stress
        (m, 3, 3) [Pa], positive in tension.
    field_strengths
        (m, scalars, 3), minus the gradients of the potentials: E [V/m], H [A/m].
    flux_densities
        (m, scalars, 3): D [C/m^2], B [Wb/m^2].
    fields
        Field set whose scalar fields are the entries of potentials, field strengths and flux densities.
    grid
        The grid of the points, if they were given by one.
    """

    points: Array
    displacement: Array
    potentials: Array
    strain: Array
    stress: Array
    field_strengths: Array
    flux_densities: Array
    fields: FieldSet = MEE
    grid: PointGrid | None = None

    def __repr__(self) -> str:
        """Return words instead of long arrays."""
        return f"InteriorResult({len(self.points)} points)"

    @property
    def principal_stresses(self) -> Array:
        """Principal stresses (m, 3) in decreasing order [Pa]."""
        return np.asarray(np.linalg.eigvalsh(self.stress)[:, ::-1])

    @property
    def von_mises(self) -> Array:
        """Equivalent stress of von Mises (m,) [Pa]."""
        deviator = self.stress - np.einsum("mii->m", self.stress)[:, None, None] * np.eye(3) / 3.0
        equivalent: Array = np.sqrt(1.5 * np.einsum("mij,mij->m", deviator, deviator))
        return equivalent

    @property
    def max_shear(self) -> Array:
        """Largest shear stress (m,) [Pa], half of the equivalent stress of Tresca."""
        principal = self.principal_stresses
        return np.asarray((principal[:, 0] - principal[:, 2]) / 2.0)

    @property
    def electric_field(self) -> Array:
        """Electric field E (m, 3) [V/m]."""
        return self.field_strengths[:, self.fields.names.index(ELECTRIC_FIELD.name)]

    @property
    def magnetic_field(self) -> Array:
        """Magnetic field H (m, 3) [A/m]."""
        return self.field_strengths[:, self.fields.names.index(MAGNETIC_FIELD.name)]

    @property
    def electric_displacement(self) -> Array:
        """Electric displacement D (m, 3) [C/m^2]."""
        return self.flux_densities[:, self.fields.names.index(ELECTRIC_FIELD.name)]

    @property
    def magnetic_flux_density(self) -> Array:
        """Magnetic flux density B (m, 3) [Wb/m^2]."""
        return self.flux_densities[:, self.fields.names.index(MAGNETIC_FIELD.name)]

    def invariants(self) -> dict[str, tuple[Array, str]]:
        """Return the scalar measures (m,) and their SI units by name.

        These are the equivalent stress of von Mises, the largest shear stress, the largest principal stress, and the
        magnitude of each field strength, such as "electric_field".
        """
        named = {
            "von_mises": (self.von_mises, "Pa"),
            "max_shear": (self.max_shear, "Pa"),
            "max_principal_stress": (self.principal_stresses[:, 0], "Pa"),
        }
        for number, scalar in enumerate(self.fields.scalars):
            magnitude = np.linalg.norm(self.field_strengths[:, number], axis=1)
            named[f"{scalar.name}_field"] = (magnitude, scalar.strength_unit)
        return named

    def scalars(self) -> dict[str, tuple[Array, str]]:
        """Return the invariants, the potentials and all components (m,) with their SI units by name.

        Components are named such as "displacement_z", "stress_xz", "electric_field_x" and "electric_flux_density_z".
        """
        named = {}
        for number, scalar in enumerate(self.fields.scalars):
            named[scalar.value_name] = (self.potentials[:, number], scalar.value_unit)
        for i, x in enumerate("xyz"):
            named[f"displacement_{x}"] = (self.displacement[:, i], "m")
            for j, y in enumerate("xyz"[i:], i):
                named[f"stress_{x}{y}"] = (self.stress[:, i, j], "Pa")
            for number, scalar in enumerate(self.fields.scalars):
                named[f"{scalar.name}_field_{x}"] = (self.field_strengths[:, number, i], scalar.strength_unit)
                named[f"{scalar.name}_flux_density_{x}"] = (self.flux_densities[:, number, i], scalar.flux_unit)
        return self.invariants() | named

    def plot(self, name: str = "von_mises", ax: Any = None) -> Any:
        """Draw a scalar field on a plane section and return the axes.

        Parameters
        ----------
        name : str, optional
            Name of one of `scalars`.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; new ones by default.

        Raises
        ------
        ResultError
            For an unknown name, or if the points are not those of a plane section or a box, whose middle plane along
            its second axis is drawn.
        """
        return on_axes(ax, lambda axes: draw_plane(axes, self._plane(name)))

    def figure(self, title: str = "") -> "Figure":
        """Return the figure of a section, as `plot`: the equivalent stress, and each potential that is not zero."""
        potentials = zip(self.fields.scalars, self.potentials.T, strict=True)
        names = ["von_mises", *(scalar.value_name for scalar, values in potentials if values.any())]
        return planes_figure([self._plane(name) for name in names], title)

    def _plane(self, name: str) -> PlaneField:
        """Return a scalar field on the plane section that `plot` draws."""
        scalars, grid = self.scalars(), self.grid
        if name not in scalars:
            raise ResultError(f"unknown field {name!r}; {choices(name, scalars)}")
        if grid is None:
            raise ResultError("the points are not on a grid; allowed: fields at the points of a PointGrid")
        single = [axis for axis, count in enumerate(grid.shape) if count == 1]
        if len(single) > 1:
            raise ResultError(f"the {len(self.points)} points are on a line; allowed: a plane section or a box")
        across = single[0] if single else 1
        first, second = (axis for axis in range(3) if axis != across)
        middle, (labels, coordinates) = grid.shape[across] // 2, grid.labelled()
        values, unit = scalars[name]
        return PlaneField(
            _LABELS.get(name, name.replace("_", " ")),
            unit,
            np.moveaxis(values.reshape(grid.shape), across, 0)[middle],
            (labels[first], labels[second], labels[across]),
            (coordinates[first], coordinates[second]),
            float(coordinates[across][middle]),
        )

    def maxima(self) -> list[Maximum]:
        """Return the largest value of each invariant and its position, in the order of `invariants`."""
        return [
            Maximum(name, float(values.max()), unit, self.points[values.argmax()])
            for name, (values, unit) in self.invariants().items()
        ]


def interior(
    system: ReducedSystem,
    state: StepResult | Array,
    points: Array | PointGrid,
    fields: FieldSet | None = None,
    *,
    body: Body = "first",
    progress: Progress = silent,
) -> InteriorResult:
    """Return the fields at points inside the body of a reduced system.

    Parameters
    ----------
    system
        The reduced system.
    state
        Result of an increment, or a load (n, fields) as in `ReducedSystem.apply`.
    points
        Positions (m, 3) in global axes [m], or a grid.
    fields
        Field set of the body; by default that of the result, or the magneto-electro-elastic one for a load.
    body
        "first" or "second" of two bodies in contact. Displacement and potentials of the second one count from its
        supports and grounds, wherever a load step has moved them; positions are in the coordinates of the first.
    progress
        Function that receives the stage and the fraction of the points that is done.

    Returns
    -------
    InteriorResult
        Fields at the points.

    Raises
    ------
    CaseError
        If the system has no such body or no fields inside it, if the load has another number of fields, or if a point
        is outside the body or too close to its surface.
    """
    if isinstance(state, StepResult):
        load, fields = np.asarray(state.state.load), fields or state.fields
    else:
        load, fields = np.asarray(state, float), fields or MEE
    if body not in BODIES:
        raise CaseError(f"body {body!r}: allowed: {', '.join(BODIES)}")
    if load.shape != system.offset.shape or fields.size != system.n_fields:
        raise CaseError(
            f"the load has shape {load.shape} and {fields.size} fields; allowed: {system.offset.shape}, with the "
            f"{system.n_fields} fields of the body"
        )
    grid = points if isinstance(points, PointGrid) else None
    positions = grid.points if grid is not None else np.asarray(points, float)
    if positions.ndim != 2 or positions.shape[1] != 3 or not len(positions) or not np.isfinite(positions).all():
        raise CaseError(f"points have shape {positions.shape}; allowed: (m, 3) finite numbers, m > 0")
    if body == "second":
        interior_fields = interior_of_second(system, load, positions, progress)
    else:
        interior_fields = required_interior(system).evaluate(load, positions, progress)
    displacement, potentials = split_load(interior_fields.values)
    slopes = interior_fields.gradients[:, MECHANICAL]
    return InteriorResult(
        points=interior_fields.points,
        displacement=displacement,
        potentials=potentials,
        strain=(slopes + slopes.transpose(0, 2, 1)) / 2.0,
        stress=interior_fields.fluxes[:, :, MECHANICAL],
        field_strengths=-interior_fields.gradients[:, POTENTIALS],
        flux_densities=interior_fields.fluxes[:, :, POTENTIALS].transpose(0, 2, 1),
        fields=fields,
        grid=grid,
    )


def maxima_table(result: InteriorResult) -> LiteralTable:
    """Return a table for the terminal with the largest value and the position of each invariant that is not zero."""
    table = LiteralTable(f"largest values at {len(result.points)} points inside the body")
    for header in ("", "unit", "value", "x [m]", "y [m]", "z [m]"):
        table.add_column(header)
    for name, value, unit, position in result.maxima():
        if value == 0.0:
            continue
        table.add_row(
            _LABELS.get(name, name.replace("_", " ")),
            unit,
            f"{value:.6g}",
            *(f"{x + 0.0:.4g}" for x in position.tolist()),
        )
    return table


def write_interior(path: Path | str, result: InteriorResult) -> None:
    """Write the fields on a grid of points as a VTU file, SI units, global axes.

    Raises
    ------
    ResultError
        If the points are not those of a grid, or the file cannot be written.
    """
    import meshio  # half a second to import; only here

    if result.grid is None:
        raise ResultError("the points are not on a grid; allowed: fields at the points of a PointGrid")
    data = dict(_point_data(result))
    with replacing(Path(path)) as temporary:
        meshio.Mesh(result.points, [result.grid.cells()], point_data=data).write(temporary, file_format="vtu")


def _point_data(result: InteriorResult) -> Iterator[tuple[str, Array]]:
    """Yield labels with units and values at the points; symmetric tensors as xx, yy, zz, xy, yz, xz."""
    yield "displacement [m]", result.displacement
    stress = result.stress[:, (0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2)]
    yield "stress [Pa]", stress
    for number, scalar in enumerate(result.fields.scalars):
        yield f"{scalar.value_name} [{scalar.value_unit}]", result.potentials[:, number]
        yield f"{scalar.name}_field_strength [{scalar.strength_unit}]", result.field_strengths[:, number]
        yield f"{scalar.name}_flux_density [{scalar.flux_unit}]", result.flux_densities[:, number]
    for name, (values, unit) in result.invariants().items():
        yield (f"abs_{name}" if name.endswith("_field") else name) + f" [{unit}]", values
