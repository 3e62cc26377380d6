"""Load step: the quantities that it prescribes to the indenter."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from itertools import combinations, islice
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.contact.channels import FluxChannel
from meeframe.contact.scales import largest
from meeframe.fields import MEE, N_MECHANICAL, Array, FieldSet
from meeframe.fields.units import Quantity
from meeframe.indenters.base import N_RIGID, RIGID_MOTIONS, IndenterMotions
from meeframe.laws.base import ContactLaw, is_adhesive
from meeframe.mesh.regular import extreme_points
from meeframe.model.rolling import Rolling
from meeframe.plugin.validation import Problem, TableError, choices

_LEAST_FRACTION: Final = 1e-9
"""Least component of a motion along the normal; smaller ones are round-off of the frames."""

_MAX_MOTION: Final = 1e9
"""Largest motion in multiples of the width of the contact zone, and largest rotation [rad].

Motions that are merely not small have a diagnostic; no confusion of units leads to larger ones.
"""
MAX_SLIDING: Final = 1e12
"""Largest distance that an indenter slides in a load step [m], beyond any lifetime."""
_FURTHER_UNITS: Final = {"sliding": "m", "max_pressure_change": "1", "duration": "s"}
"""Units of the quantities of a step that are no motions or resultants."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class Step:
    """Load step in SI units; quantities that it does not name keep their values of the previous step.

    For each of the indenter's motions either the motion, from where it just touched, or the conjugate resultant is
    given. Axes, signs and reference point are those of Loading and `resultants`. Texts with units, such as "5 N",
    become SI numbers as in case files.

    Parameters
    ----------
    approach, normal_force : float, optional
        Approach [m] or normal force [N], >= 0 in compression; the force is < 0 only under laws whose surfaces attract
        each other.
    translation, tangential_force, force_ratio : pair of float, optional
        Translation (2,) [m], tangential force (2,) [N], or tangential over normal force (2,).
    tilt, moment : pair of float, optional
        Tilt (2,) [rad] or moment (2,) [N m].
    twist, torque : float, optional
        Twist [rad] or torque [N m].
    scalars : mapping of str to float, optional
        For each scalar field, by name, the potential of the indenter or the total flux, such as {"electric_potential":
        5.0} [V] or {"charge": 0.0} [C].
    sliding : float, optional
        Distance, >= 0 and <= 1e12, that the indenter slides over the body in the whole step [m], far more than the
        contact is wide, while the contact zone stays; it wears surfaces in place of the slip that the motions cause.
    max_pressure_change : float, optional
        Largest change of the pressure, its modulus integrated over the contact, as a fraction of the normal force, > 0
        and <= 1: increments in which surfaces wear are divided until it holds in each.
    duration : float, optional
        Time of the whole step [s] > 0, for laws that need it.
    rolling : Rolling, optional
        Rolling of the contact over the surface. It determines the twist, by its spin, and with a creepage also the
        translation.
    increments : int, optional
        Number of equal increments in which the step is applied; with rolling, one for each cell.
    fields : FieldSet, optional
        Field set to which the names in `scalars` belong.

    Raises
    ------
    CaseError
        If two quantities determine the same motion, or a value is not allowed.
    """

    approach: float | None = None
    normal_force: float | None = None
    translation: Pair | None = None
    tangential_force: Pair | None = None
    force_ratio: Pair | None = None
    tilt: Pair | None = None
    moment: Pair | None = None
    twist: float | None = None
    torque: float | None = None
    scalars: Mapping[str, float] = field(default_factory=dict)
    sliding: float | None = None
    max_pressure_change: float | None = None
    duration: float | None = None
    rolling: Rolling | None = None
    increments: int = 1
    fields: FieldSet = MEE

    def __post_init__(self) -> None:
        motions = IndenterMotions(self.fields)
        for key in (*_rigid_keys(), *_FURTHER_UNITS):
            object.__setattr__(self, key, _in_si(key, getattr(self, key), motions))
        for key in self.scalars:
            if key not in motions.columns or key in _rigid_keys():
                names = [name for name in motions.columns if name not in _rigid_keys()]
                raise CaseError(f"scalars: unknown name {key!r}; {choices(key, names)}")
        scalars = {key: _in_si(key, value, motions) for key, value in self.scalars.items()}
        object.__setattr__(self, "scalars", scalars)
        for key, value in self.prescribed.items():
            columns = motions.columns[key]
            if value.shape != (columns.stop - columns.start,) or not np.isfinite(value).all():
                count = "one finite number" if columns.stop - columns.start == 1 else "two finite numbers"
                original = scalars[key] if key in scalars else getattr(self, key)
                raise CaseError(f"{key} = {original!r}; allowed: {count} [{motions.units[key]}]")
        for one, other in combinations(self.prescribed, 2):
            if motions.columns[one] == motions.columns[other]:
                raise CaseError(
                    f"{one} and {other} are both given; allowed: one of them, the other one follows from it"
                )
        self._check_rolling()
        if self.duration is not None and not (np.ndim(self.duration) == 0 and 0.0 < self.duration < math.inf):
            raise CaseError(f"duration = {self.duration!r}; allowed: finite numbers > 0 [s]")
        if self.sliding is not None and not (np.ndim(self.sliding) == 0 and 0.0 <= self.sliding <= MAX_SLIDING):
            raise CaseError(f"sliding = {self.sliding!r}; allowed: numbers >= 0 and <= {MAX_SLIDING:g} [m]")
        change = self.max_pressure_change
        if change is not None and not (np.ndim(change) == 0 and 0.0 < change <= 1.0):
            raise CaseError(f"max_pressure_change = {change!r}; allowed: numbers > 0 and <= 1")
        if not isinstance(self.increments, int) or self.increments < 1:
            raise CaseError(f"increments = {self.increments!r}; allowed: whole numbers from 1")

    def _check_rolling(self) -> None:
        """Raise CaseError if a quantity is prescribed that the rolling determines."""
        if self.rolling is None:
            return
        keys = ["translation", "twist", "torque"]
        if self.rolling.creepage is not None:
            keys += ["tangential_force", "force_ratio"]
        for key in keys:
            if getattr(self, key) is not None:
                rotates = key in ("twist", "torque")
                allowed = (
                    "its spin" if rotates else "its creepage, or tangential_force or force_ratio without a creepage"
                )
                raise CaseError(f"{key} and rolling are both given; allowed: rolling with {allowed}")
        if self.rolling.speed is not None and self.duration is not None:
            raise CaseError("duration and the speed of rolling are both given; allowed: one of them")

    @property
    def prescribed(self) -> Mapping[str, Array]:
        """Prescribed quantities by key, (1,) or (2,)."""
        values = {key: getattr(self, key) for key in _rigid_keys()} | dict(self.scalars)
        return {key: np.atleast_1d(np.asarray(value, float)) for key, value in values.items() if value is not None}

    @property
    def increment_duration(self) -> float | None:
        """Time of each increment [s]; None if the step has no duration."""
        return None if self.duration is None else self.duration / self.increments

    @property
    def increment_sliding(self) -> float | None:
        """Distance that the indenter slides in each increment [m]; None if the step has none."""
        return None if self.sliding is None else self.sliding / self.increments


@cache
def _rigid_keys() -> tuple[str, ...]:
    """Return the keys of rigid motions and their resultants."""
    return tuple(entry.name for entry in fields(Step) if entry.name in IndenterMotions().columns)


def _in_si(key: str, value: Any, motions: IndenterMotions) -> Any:
    """Return the value of a key as a number or a tuple of numbers, in SI units; raise CaseError if it holds none."""
    quantity = Quantity({**motions.units, **_FURTHER_UNITS}[key].removeprefix("1"))
    try:
        if isinstance(value, str):
            return quantity.convert(value)
        if isinstance(value, list | tuple):
            value = tuple(quantity.convert(number) if isinstance(number, str) else number for number in value)
        numbers = np.asarray(value)
        if value is not None and numbers.dtype.kind not in "fiu":
            raise ValueError(f"expected {quantity.expected}")
    except ValueError as error:
        raise CaseError(f"{key} = {value!r}: {error}") from None
    # also of arrays, which are mutable and not comparable
    return numbers.item() if numbers.size == 1 else tuple(numbers.tolist())


def check_first(step: Step) -> None:
    """Raise CaseError unless the first step of an unloaded body prescribes an approach or a normal force."""
    if step.approach is None and step.normal_force is None:
        raise CaseError("the first load step gives neither approach nor normal_force; allowed: one of them")


def check_pull(step: Step, law: ContactLaw) -> None:
    """Raise TableError if a load step pulls on surfaces that do not attract each other."""
    force = step.prescribed.get("normal_force", np.zeros(1)).item()
    if force < 0 and not is_adhesive(law):
        allowed = "allowed: numbers >= 0 [N], pressing on the body, unless the contact law is adhesive"
        raise TableError(Problem(("normal_force",), allowed, force))


def check_size(step: Step, points: Array) -> None:
    """Raise TableError if a motion exceeds the contact zone, of nodes (n, 3), beyond anything physical."""
    width, units = float(np.ptp(extreme_points(points), axis=0).max()), IndenterMotions().units
    for key in RIGID_MOTIONS:
        value, unit = step.prescribed.get(key, np.zeros(1)), units[key]
        limit = _MAX_MOTION * (width if unit == "m" else 1.0)
        if largest(value) > limit:
            of_width = f", {_MAX_MOTION:g} times the width of the contact zone" if unit == "m" else ""
            number = value.item() if value.size == 1 else value.tolist()
            raise TableError(Problem((key,), f"allowed: at most {limit:.3g} {unit}{of_width}", number))


def check_duration(step: Step, number: int, law: ContactLaw) -> None:
    """Raise CaseError if the contact law needs a duration that the load step, number from 1, does not give."""
    if law.needs_duration and step.duration is None:
        raise CaseError(
            f"load step {number} has no duration, which the contact law {type(law).__name__} needs; "
            "allowed: a duration > 0 [s]"
        )


def check_names(step: Step, motions: IndenterMotions) -> None:
    """Raise CaseError if a load step prescribes a potential or flux of a field that the case does not have."""
    for key in step.scalars:
        if key not in motions.columns:
            names = [name for name in motions.columns if name not in _rigid_keys()]
            raise CaseError(f"{key}: no field of the case has this potential or flux; {choices(key, names)}")


def check_resisted(step: Step, motions: IndenterMotions, resists: NDArray[np.bool_]) -> None:
    """Raise TableError if a resultant is prescribed for a motion that nothing resists; resists: (motions.size,)."""
    for key, value in step.prescribed.items():
        if key not in motions.motions and np.any((value != 0.0) & ~resists[motions.columns[key]]):
            why = "insulate" if key in step.scalars else "admit no traction that resists this motion"
            number = value.item() if value.size == 1 else value.tolist()
            raise TableError(Problem((key,), f"the laws of the contact {why}; allowed: 0, or other laws", number))


def resisted(modes: Sequence[Array], contact: ContactLaw, channels: tuple[FluxChannel, ...]) -> NDArray[np.bool_]:
    """Return which motions of the indenter, of modes (motions, n, fields), the laws may resist, (motions,).

    Motions are resisted by normal tractions, or by tangential ones that the law admits in that direction; potentials if
    their law conducts.
    """
    scaling = contact.tangential_scaling()
    mechanical = []
    for mode in islice(modes, N_RIGID):
        size = max(largest(mode[:, column]) for column in range(N_MECHANICAL))
        held = largest(mode[:, 2])
        if held <= _LEAST_FRACTION * size and scaling.any():
            held = largest(mode[:, :2] @ scaling)
        mechanical.append(held > _LEAST_FRACTION * size)
    return np.array([*mechanical, *(channel.is_conducting for channel in channels)])
