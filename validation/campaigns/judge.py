"""Judgement of a converged increment from its result file alone.

The file is read by h5py, its case by tomllib. Laws are stated in `admissibility`, motions and balances here; nothing of
meeframe's solvers, laws or contact problems is used. Only the compliance of each body comes from its formulation, which
reduces the body again, and is applied to the stored loads.
"""

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import admissibility as laws
import h5py
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Compliance = Callable[[Array, Array], Array]
"""Displacement (n, 5) at points (n, 3) under a load (n, 5), in the global axes of the body, potentials negated."""
TURN_OVER: Final = np.array([1.0, -1.0, -1.0])

SCALARS: Final = ("electric", "magnetic")
FLUXES: Final = {"electric": "electric_flux", "magnetic": "magnetic_flux"}
TOTALS: Final = {"electric": "charge", "magnetic": "magnetic_flux"}
NOISE: Final = 1e-7
"""Potentials and fluxes below this fraction of those that would do the work of the mechanical loads are noise."""
CANCELLED: Final = 1e-3
"""Potentials below this fraction of those that tractions or fluxes alone would cause cancel: they are no unit."""
PAST: Final = 0.1
"""Least unit of a quantity, as a fraction of its largest value in the run: an unloaded body holds round-off."""


@dataclass(frozen=True)
class Increment:
    """Arrays of an increment as they stand in the file; loading and prescribed by name."""

    number: tuple[int, int]
    status: str
    message: str
    fields: Mapping[str, Array]
    second: Mapping[str, Array] | None
    loading: Mapping[str, Array]
    prescribed: Mapping[str, Array]

    @property
    def displacement(self) -> Array:
        """Displacement of the body relative to the second one, (n, 3)."""
        second: Array | float = 0.0 if self.second is None else self.second["displacement"]
        return np.asarray(self.fields["displacement"] - second)

    @property
    def largest_length(self) -> float:
        """Largest displacement or motion."""
        motions = abs(float(self.loading["approach"])), np.abs(self.loading["translation"]).max()
        return float(max(np.abs(self.displacement).max(), *motions))


@dataclass(frozen=True)
class File:
    """A result file."""

    case: dict[str, Any]
    points: Array
    frames: Array
    weights: Array
    increments: tuple[Increment, ...]


SHAPES: Final = {
    "initial_gap": (),
    "traction": (3,),
    "displacement": (3,),
    "electric_potential": (),
    "magnetic_potential": (),
    "electric_flux": (),
    "magnetic_flux": (),
    "slip": (2,),
    "total_slip": (2,),
    "slip_path": (),
}


def read(folder: Path) -> File:
    """Return the content of result.h5 in a folder."""
    with h5py.File(folder / "result.h5", "r") as file:
        zone = {name: file[f"zone/{name}"][()] for name in ("frames", "weights")}
        zone["points"] = _points(file["zone/points"])
        steps = [_increment(file["steps"][name], len(zone["points"])) for name in sorted(file["steps"])]
        return File(tomllib.loads(file.attrs["case"]), **zone, increments=tuple(steps))


def _points(entry: Any) -> Array:
    """Return the points (n, 3) of a zone from a dataset, or from the coordinates of the rows and columns of a grid."""
    if isinstance(entry, h5py.Dataset):
        return np.asarray(entry[()])
    x, y = np.meshgrid(entry["x"][()], entry["y"][()], indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def _increment(group: Any, n: int) -> Increment:
    zero = group.attrs["zero"].split()

    def array(owner: Any, name: str, shape: tuple[int, ...], zeros: list[str]) -> Array:
        return np.zeros((n, *shape)) if name in zeros else np.asarray(owner[name][()], float)

    fields = {name: array(group, name, shape, zero) for name, shape in SHAPES.items()}
    fields["area_fraction"] = group["area_fraction"][()] if "area_fraction" in group else np.ones(n)
    second = None
    if "second_body" in group:
        owner, zeros = group["second_body"], group["second_body"].attrs["zero"].split()
        names = ("displacement", "electric_potential", "magnetic_potential")
        second = {name: array(owner, name, SHAPES[name], zeros) for name in names}
    loading = {name: np.asarray(entry[()], float) for name, entry in group["loading"].items() if name != "prescribed"}
    prescribed = {name: np.asarray(entry[()], float) for name, entry in group["loading/prescribed"].items()}
    number = int(group["step"][()]), int(group["increment"][()])
    return Increment(number, group.attrs["status"], group.attrs["message"], fields, second, loading, prescribed)


def judge(file: File, compliances: tuple[Compliance, ...]) -> list[dict[str, float]]:
    """Return the violations by name of each increment, relative to the magnitudes of its solution.

    compliances: of the body, and of the second body if there is one.
    """
    slip, path = np.zeros((len(file.points), 2)), np.zeros(len(file.points))
    verdicts = []
    for increment in file.increments:
        if increment.status != "converged":
            verdicts.append({})
            continue
        state = _State(file, increment, slip, path, compliances)
        verdicts.append(state.violations())
        path = path + np.where(state.nodes.pressure > 0.0, np.linalg.norm(state.nodes.slip, axis=1), 0.0)
        slip = state.total_slip
    return verdicts


class _State:
    """State of one increment with its units; slip, path: total slip and slip path at its beginning."""

    def __init__(
        self, file: File, increment: Increment, slip: Array, path: Array, compliances: tuple[Compliance, ...]
    ) -> None:
        self.file, self.increment, self.law = file, increment, _table(file.case["contact"]["law"])
        self.compliances = compliances
        fields = increment.fields
        self.displacement = increment.displacement
        self.drop = {name: self._drop(name) for name in SCALARS}
        gap = fields["initial_gap"] - self.displacement[:, 2]
        self.total_slip = self._tangential_motion() - self.displacement[:, :2]
        pressure = laws.attraction(self.law, np.where(np.isfinite(gap), gap, np.inf)) - fields["traction"][:, 2]
        self.pressure_unit = self._largest("traction") or 1.0
        self.length_unit = self._length_unit()
        duration = increment.loading.get("duration")
        self.nodes = laws.Nodes(
            pressure=pressure,
            gap=gap,
            friction=fields["traction"][:, :2],
            slip=self.total_slip - slip,
            path=path,
            pressure_unit=self.pressure_unit,
            length_unit=self.length_unit,
            duration=None if duration is None else float(duration),
        )

    def _largest(self, name: str) -> float:
        """Return the largest modulus of a field now, or a fraction of that in any converged increment."""
        past = (np.abs(each.fields[name]).max() for each in self.file.increments if each.status == "converged")
        return max(float(np.abs(self.increment.fields[name]).max()), PAST * float(max(past)))

    def _length_unit(self) -> float:
        """Return the largest displacement or motion now, or a fraction of that in any converged increment."""
        past = (each.largest_length for each in self.file.increments if each.status == "converged")
        return max(self.increment.largest_length, PAST * max(past)) or 1.0

    def _drop(self, name: str) -> Array:
        second = self.increment.second
        across = 0.0 if second is None else second[f"{name}_potential"]
        drop: Array = self.increment.fields[f"{name}_potential"] - across
        return drop - float(self.increment.loading[f"{name}_potential"])

    def _tangential_motion(self) -> Array:
        """Return the motion (n, 2) of the indenter along e1, e2 of the frames."""
        motion = self._motion()
        return np.einsum("nai,ni->na", self.file.frames[:, :2], motion)

    def _motion(self) -> Array:
        """Return the rigid motion (n, 3) in global axes: approach against the axis, translation and rotations."""
        loading = self.increment.loading
        e1, e2, axis = loading["axes"]
        shift = loading["translation"][0] * e1 + loading["translation"][1] * e2 - float(loading["approach"]) * axis
        turn = loading["tilt"][0] * e1 + loading["tilt"][1] * e2 + float(loading["twist"]) * axis
        return np.asarray(shift + np.cross(turn, self.file.points - loading["reference"]))

    def violations(self) -> dict[str, float]:
        """Return the largest violation of each statement."""
        violations = {name: values.max(initial=0.0) for name, values in self._laws().items()}
        violations |= self._compliance()
        violations |= self._balance()
        violations |= self._history()
        violations["position"] = self._position()
        if not all(np.isfinite(value).all() for name, value in self.increment.fields.items() if name != "initial_gap"):
            violations["not finite"] = math.inf
        return {name: float(np.nan_to_num(value, nan=np.inf)) for name, value in violations.items()}

    def _laws(self) -> dict[str, Array]:
        friction = np.linalg.norm(self.nodes.friction, axis=1) / self.pressure_unit
        values = dict(laws.normal_violations(self.law, self.nodes))
        if "mu" not in self.law and self.law["name"] in ("signorini", "signorini-gap", "compliant", "dmt", "dugdale"):
            values["friction without a law"] = friction
        else:
            values |= laws.friction_violations(self.law, self.nodes)
        outside = ~np.isfinite(self.increment.fields["initial_gap"])
        values["load outside the indenter"] = np.where(outside, np.abs(self.nodes.pressure) / self.pressure_unit, 0.0)
        values = {name: np.where(outside & (name == "complementarity"), 0.0, each) for name, each in values.items()}
        tables = self.file.case.get("conductivity", {})
        for name in SCALARS:
            law = _table(tables[name]) if name in tables else None
            units, flux = self._flux_units(name), self.increment.fields[FLUXES[name]]
            share = self.increment.fields["area_fraction"]
            values[f"{name} conduction"] = laws.flux_violation(law, self.nodes, self.drop[name], flux, units, share)
        return values

    def _flux_units(self, name: str) -> tuple[float, float]:
        """Return units of drop and flux: the largest of the solution, unless that is noise."""
        work = self.pressure_unit * self.length_unit
        flux, potential = (self._largest(key) for key in (FLUXES[name], f"{name}_potential"))
        loading = abs(float(self.increment.loading[f"{name}_potential"]))
        second = 0.0 if self.increment.second is None else np.abs(self.increment.second[f"{name}_potential"]).max()
        potential = max(float(potential), loading, float(second), CANCELLED * self._caused[name])
        noise = max(NOISE * work / max(flux, 1e-300) if flux > 0.0 else 0.0, 1e-300)
        return max(potential, min(noise, potential or noise)), max(flux, NOISE * work / max(potential, 1e-300))

    @cached_property
    def _caused(self) -> dict[str, float]:
        """Largest potentials that the tractions alone or the fluxes alone would cause, in any of the bodies."""
        fields = self.increment.fields
        load = self._global(fields["traction"], fields["electric_flux"], fields["magnetic_flux"])
        caused = np.zeros(len(SCALARS))
        for chosen in (slice(3), slice(3, 5)):
            part = np.zeros_like(load)
            part[:, chosen] = load[:, chosen]
            for response in self._responses(part):
                caused = np.maximum(caused, np.abs(response[:, 3:]).max(axis=0))
        return dict(zip(SCALARS, caused.tolist(), strict=True))

    def _responses(self, load: Array) -> list[Array]:
        """Return the displacements (n, 5) of each body by a load (n, 5), without those of no load."""
        bodies = range(len(self.compliances))
        return [self._respond(number, load) - unloaded for number, unloaded in zip(bodies, self._unloaded, strict=True)]

    @cached_property
    def _unloaded(self) -> list[Array]:
        nothing = np.zeros((len(self.file.points), 5))
        return [self._respond(number, nothing) for number in range(len(self.compliances))]

    def _respond(self, number: int, load: Array) -> Array:
        """Return the displacement (n, 5) of a body by a load (n, 5), both in global axes."""
        turn = np.ones(5) if number == 0 else np.array([*TURN_OVER, 1, 1])
        return turn * self.compliances[number](self.file.points * turn[:3], turn * load)

    def _compliance(self) -> dict[str, float]:
        fields, units = self.increment.fields, [self.length_unit] * 3 + [self._flux_units(name)[0] for name in SCALARS]
        plain = (fields["area_fraction"] == 1.0) & ~_near(self.file.points, fields["area_fraction"] < 1.0)
        load = self._global(fields["traction"], fields["electric_flux"], fields["magnetic_flux"])
        worst = {}
        for number in range(len(self.compliances)):
            stored = fields if number == 0 else self.increment.second
            assert stored is not None
            displacement = self._global(
                stored["displacement"], -stored["electric_potential"], -stored["magnetic_potential"]
            )
            expected = self._respond(number, load if number == 0 else -load)
            # at the contact edge between nodes, loaded nodes have a compliance of their own
            difference = np.abs(expected - displacement)[plain] / units
            worst["compliance" if number == 0 else "compliance of the second body"] = difference.max(initial=0.0)
        return worst

    def _global(self, vectors: Array, *scalars: Array) -> Array:
        """Return vectors (n, 3) in global axes and scalars as columns, (n, 5)."""
        return np.column_stack([np.einsum("nai,na->ni", self.file.frames, vectors), *scalars])

    def _balance(self) -> dict[str, float]:
        """Return the violations of prescribed resultants, relative to the moduli of their contributions."""
        loading, weights, fields = self.increment.loading, self.file.weights, self.increment.fields
        forces = weights[:, None] * np.einsum("nai,na->ni", self.file.frames, fields["traction"])
        moments = np.cross(self.file.points - loading["reference"], forces)
        by_force, by_moment = forces @ loading["axes"].T, moments @ loading["axes"].T
        normal = -by_force[:, 2:]
        contributions = {
            "normal_force": normal,
            "tangential_force": by_force[:, :2],
            "moment": by_moment[:, :2],
            "torque": by_moment[:, 2:],
            **{TOTALS[name]: (weights * fields[FLUXES[name]])[:, None] for name in SCALARS},
        }
        worst = {}
        for name, value in self.increment.prescribed.items():
            total = np.atleast_1d(value)
            if name == "force_ratio":
                parts, total = by_force[:, :2] - total * normal, np.zeros(2)
                scale = np.abs(normal).sum()
            else:
                parts = contributions[name]
                scale = max(np.abs(parts).sum(), np.abs(total).max(), self._least_total(name))
            imbalance = float(np.abs(parts.sum(axis=0) - total).max())
            worst[f"prescribed {name}"] = imbalance / (scale or 1.0)
            if name in TOTALS.values():
                worst[f"prescribed {name}"] = min(worst[f"prescribed {name}"], self._by_potential(name, imbalance))
        return worst

    def _by_potential(self, total: str, imbalance: float) -> float:
        """Return the change of a potential that conducts an imbalance of its total, relative to the largest potential.

        Fluxes through the contact are as exact as the potentials that drive them.
        """
        (index,) = (index for index, name in enumerate(SCALARS) if TOTALS[name] == total)
        law = self.file.case.get("conductivity", {}).get(SCALARS[index], "insulating")
        nodes, drop = self.nodes, np.abs(self.drop[SCALARS[index]])
        touches = nodes.pressure > laws.MARGIN * nodes.pressure_unit
        if _table(law)["name"] == "insulating" or not touches.any():
            return math.inf
        kappa = laws.conductivity(_table(law), nodes.pressure, touches, np.maximum(nodes.gap, 0.0), drop)
        load = np.where(touches[:, None] & (np.arange(5) == 3 + index), 1.0, 0.0)
        resistance = np.abs(sum(response[:, 3 + index] for response in self._responses(load)))
        conducts = touches & (kappa > 0.0)
        conductance = float(self.file.weights[conducts] @ (1.0 / (1.0 / kappa[conducts] + resistance[conducts])))
        return imbalance / (conductance * self._flux_units(SCALARS[index])[0]) if conductance > 0.0 else math.inf

    def _least_total(self, name: str) -> float:
        if name not in TOTALS.values():
            extent = float(np.ptp(self.file.points, axis=0).max())
            arm = extent if name in ("moment", "torque") else 1.0
            return 1e-3 * self.pressure_unit * float(np.abs(self.file.weights).sum()) * arm
        electric = name == TOTALS["electric"]
        return self._flux_units("electric" if electric else "magnetic")[1] * float(np.abs(self.file.weights).sum())

    def _history(self) -> dict[str, float]:
        """Return differences between slips in the file and those of the motions and displacements."""
        fields = self.increment.fields
        return {
            "slip": np.abs(fields["slip"] - self.nodes.slip).max() / self.length_unit,
            "total slip": np.abs(fields["total_slip"] - self.total_slip).max() / self.length_unit,
        }

    def _position(self) -> float:
        """Return the difference of motions from those that the case prescribes at the end of a step."""
        number, increment = self.increment.number
        steps = self.file.case["steps"]
        if increment != steps[number - 1].get("increments", 1):
            return 0.0
        prescribed: dict[str, Any] = {}
        for step in steps[:number]:
            for one, other in CONJUGATE:
                if one in step or other in step or (one == "translation" and "force_ratio" in step):
                    prescribed.pop(one, None)
                if one in step:
                    value = step[one]
                    if one == "translation" and "direction" in step:
                        value = [value * math.cos(step["direction"]), value * math.sin(step["direction"])]
                    prescribed[one] = value
        worst = 0.0
        for name, value in prescribed.items():
            actual, expected = np.atleast_1d(self.increment.loading[name]), np.atleast_1d(value)
            worst = max(worst, float(np.abs(actual - expected).max() / (np.abs(expected).max() or 1.0)))
        return worst


CONJUGATE: Final = (
    ("approach", "normal_force"),
    ("translation", "tangential_force"),
    ("tilt", "moment"),
    ("twist", "torque"),
    ("electric_potential", "charge"),
    ("magnetic_potential", "magnetic_flux"),
)


def _table(law: Any) -> dict[str, Any]:
    return {"name": law} if isinstance(law, str) else dict(law)


def _near(points: Array, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the nodes whose distance from chosen ones is less than one and a half spacings."""
    if not chosen.any():
        return np.zeros(len(points), bool)
    spacing = np.sort(np.linalg.norm(points - points[0], axis=1))[1]
    distance = np.linalg.norm(points[:, None] - points[chosen][None], axis=2).min(axis=1)
    return np.asarray(distance < 1.5 * spacing)
