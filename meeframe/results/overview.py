"""Numbers that reports need of all increments of a run, in memory even where the increments are not."""

import json
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, Final, NamedTuple, Protocol, final, overload

import numpy as np

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.problem import Status
from meeframe.fields import MEE, FieldSet
from meeframe.indenters.base import IndenterMotions
from meeframe.results import schema
from meeframe.results.balance import Unbalance, unbalance
from meeframe.results.records import Region, StepResult, Zone
from meeframe.results.resultants import resultants

FLUX_MODULI: Final = "flux_moduli"
"""Entry of digests alone."""


class Increments(Protocol):
    """Result, or any other record with the finished increments of a case."""

    @property
    def zone(self) -> Zone:
        """Nodes of the contact zone."""

    @property
    def steps(self) -> Sequence[StepResult]:
        """Finished increments, in order."""


class Overview(NamedTuple):
    """Numbers of an increment that reports need of all increments: see StepResult and Resultants."""

    step: int
    increment: int
    status: Status
    message: str
    contact_at_zone_boundary: bool
    duration: float | None
    normal_force: float
    dissipated_energy: float


@final
class Peaks:
    """Largest moduli of the nodal fields over increments, by name, and their phenomena: see `schema.is_present`."""

    def __init__(self) -> None:
        self.values: dict[str, float] = {}
        self.phenomena: set[str] = set()

    def add(self, zone: Zone, step: StepResult) -> None:
        """Include an increment.

        Scalar fields and wear are present if one of their fields is not zero, friction if there are tangential
        tractions or nodes that stick, and slip if there is friction or wear.
        """
        for field in schema.nodal_fields(step.fields):
            values = field.values(zone, step)
            earlier = self.values.setdefault(field.name, 0.0)
            if not values.any():
                continue
            self.values[field.name] = max(earlier, float(np.nanmax(np.abs(values), initial=0.0)))
            if field.phenomenon not in {schema.FRICTION, schema.SLIP}:  # smooth surfaces slip, too
                self.phenomena.add(field.phenomenon)
        if step.traction[:, :2].any() or (step.region == Region.STICK).any():
            self.phenomena.add(schema.FRICTION)
        if not self.phenomena.isdisjoint({schema.FRICTION, schema.WEAR}):
            self.phenomena.add(schema.SLIP)


@final
class StoredSteps(Sequence[StepResult]):
    """Increments of a run that are read from its folder whenever they are asked for.

    Reports read nothing, because what they need is collected while increments pass: about a kilobyte of each.

    Parameters
    ----------
    read : callable
        Returns an iterator over all increments in order.
    """

    def __init__(self, read: Callable[[], Iterator[StepResult]]) -> None:
        self._read = read
        self._first = b""
        self._digests: list[bytes] = []
        self.overviews: list[Overview] = []
        self.peaks = Peaks()
        self.fields = MEE

    def add(self, zone: Zone, step: StepResult) -> None:
        """Collect what reports need of one more increment, which is in the folder."""
        text = json.dumps(digest(step, zone)).encode()
        self._first = self._first or text  # others hardly differ from it: a third as long with it as a dictionary
        packer = zlib.compressobj(zdict=self._first)
        self._digests.append(packer.compress(text) + packer.flush())
        self.overviews.append(overview(step, zone))
        self.peaks.add(zone, step)
        self.fields = step.fields

    def digest(self, number: int) -> dict[str, Any]:
        """Return the digest of the increment of a number, from 0."""
        text = zlib.decompressobj(zdict=self._first).decompress(self._digests[number])
        entries: dict[str, Any] = json.loads(text)
        return entries

    def __len__(self) -> int:
        return len(self.overviews)

    def __iter__(self) -> Iterator[StepResult]:
        return self._read()

    @overload
    def __getitem__(self, index: int) -> StepResult: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[StepResult, ...]: ...
    def __getitem__(self, index: int | slice) -> StepResult | tuple[StepResult, ...]:
        numbers = range(len(self))[index]  # IndexError if there is none
        chosen = numbers if isinstance(numbers, range) else [numbers]
        read = islice(enumerate(self), max(chosen, default=-1) + 1)
        steps = {number: step for number, step in read if number in chosen}
        return tuple(steps[number] for number in numbers) if isinstance(numbers, range) else steps[numbers]


@memoize_by_identity
def overview(step: StepResult, zone: Zone) -> Overview:
    """Return the overview of an increment."""
    totals = resultants(zone, step)
    return Overview(
        step.step,
        step.increment,
        step.status,
        step.message,
        step.contact_at_zone_boundary,
        step.loading.duration,
        totals.normal_force,
        totals.dissipated_energy,
    )


def overviews(result: Increments) -> Sequence[Overview]:
    """Return the overviews of all increments."""
    if isinstance(result.steps, StoredSteps):
        return result.steps.overviews
    return [overview(step, result.zone) for step in result.steps]


def fields_of(result: Increments) -> FieldSet:
    """Return the field set of the increments."""
    steps = result.steps
    return steps.fields if isinstance(steps, StoredSteps) else steps[0].fields if steps else MEE


def peaks(result: Increments) -> Peaks:
    """Return the largest moduli of the nodal fields over all increments."""
    return result.steps.peaks if isinstance(result.steps, StoredSteps) else _peaks(result)


@memoize_by_identity
def _peaks(result: Increments) -> Peaks:
    largest = Peaks()
    for step in result.steps:
        largest.add(result.zone, step)
    return largest


def digests(result: Increments, numbers: Sequence[int] | None = None) -> Iterator[dict[str, Any]]:
    """Yield the digests of the increments of these numbers, from 0, or of all."""
    steps = result.steps
    for number in range(len(steps)) if numbers is None else numbers:
        yield steps.digest(number) if isinstance(steps, StoredSteps) else digest(steps[number], result.zone)


@memoize_by_identity
def digest(step: StepResult, zone: Zone) -> dict[str, Any]:
    """Return the entry of an increment in summary.json, with numbers that are not finite, and what curves need besides.

    These are FLUX_MODULI, the integrals of the moduli of the fluxes. Values are of plain Python types.
    """
    totals, balance = schema.totals(zone, step), unbalance(step.boundary, step.fluxes)
    loading = step.loading
    entries: dict[str, Any] = _plain(
        {
            "step": step.step,
            "increment": step.increment,
            **{name: getattr(loading, name) for name in IndenterMotions(step.fields).motions},
            "prescribed": dict(loading.prescribed),
            "duration": loading.duration,
            **totals,
            "rolling": schema.rolling_totals(zone, step) or None,
            "contact_at_zone_boundary": step.contact_at_zone_boundary,
            "unbalance": None if balance is None else _unbalance(balance, step.fields),
            "iterations": step.iterations,
            "residual": step.residual,
            "status": str(step.status),
            "message": step.message,
            FLUX_MODULI: zone.weights @ np.abs(step.fluxes),
        }
    )
    return entries


def _unbalance(balance: Unbalance, fields: FieldSet) -> dict[str, Any]:
    totals = {scalar.resultant: total for scalar, total in zip(fields.scalars, balance.fluxes.tolist(), strict=True)}
    return {"force": balance.force, **totals, "relative": balance.relative}


def _plain(value: Any) -> Any:
    """Return a value without arrays and numbers of numpy."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value
