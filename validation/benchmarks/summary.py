"""The table at the head of docs/performance.md: every demand, what was found, those that are not met first."""

from collections.abc import Callable, Iterable
from types import ModuleType

import five_fields
import half_space
import half_space_friction
from common import Record, table, verdict

LEAST_SIZE = 512
"""Nodes along a side from which on half spaces have to be faster than others."""
GPU = ("GPU, optional: half spaces and kernels on a CUDA device", "not done: no such device could be had for it", "")


def head(parts: Iterable[tuple[str, ModuleType, Record]]) -> str:
    """The table of the parts that have demands: name, module, record."""
    rows: list[tuple[str, str, bool]] = []
    older = []
    for name, module, record in parts:
        try:
            rows += OTHERS[name](record) if name in OTHERS else getattr(module, "verdicts", _none)(record)
        except KeyError:
            older.append((module.TITLE, "to be measured again", ""))
    rows.sort(key=lambda row: row[2])
    told = [(asked, found, verdict(met)) for asked, found, met in rows]
    return table(("demand", "found", "verdict"), [*told, *older, GPU])


def _none(_record: Record) -> list[tuple[str, str, bool]]:
    return []


def _half_space(record: Record) -> list[tuple[str, str, bool]]:
    asked = f"half space: {half_space.TIMES_FASTER:g} times faster than the better of Tamaas and ContactMechanics"
    demands = []
    for name in ("sphere", "rough, periodic", "rough, free"):
        rows = {n: row for n, row in record[name].items() if int(n) >= LEAST_SIZE}
        gains = {n: half_space.speedup(row, ("built", "solved")) for n, row in rows.items()}
        told = ", ".join(f"{gain:.1f} times at {n} x {n}" for n, gain in gains.items())
        met = min(gains.values(), default=0.0) >= half_space.TIMES_FASTER
        demands.append((f"{asked}, {name}", told, met))
    return demands


def _friction(record: Record) -> list[tuple[str, str, bool]]:
    rows = record["free"]
    sizes = f"{' to '.join((min(rows, key=int), max(rows, key=int)))} squared"
    residual = max(row["residual"] for row in rows.values())
    products = [row["products"] for row in rows.values()]
    growth = max(products) / products[0]
    return [
        (
            f"half space with friction: residual {half_space_friction.MOST_RESIDUAL:g}, {sizes}",
            f"{residual:.0e}",
            residual <= half_space_friction.MOST_RESIDUAL,
        ),
        (
            "half space with friction: iterations nearly constant with the grid",
            f"products {', '.join(map(str, products))}",
            growth <= half_space_friction.NEARLY_CONSTANT,
        ),
    ]


def _five_fields(record: Record) -> list[tuple[str, str, bool]]:
    by_auto = [record["conjugate gradients"], *record["harder"].values()]
    without = {
        n: max(rows[n]["five by auto"] / rows[n]["one by auto"] for rows in by_auto if n in rows)
        for n in record["conjugate gradients"]
    }
    runs = {n: row["runs"] for n, row in record["newton"].items()}
    with_friction = {
        n: row["five fields"]["processor"] / row["one field: pressure"]["processor"] for n, row in runs.items()
    }
    return [
        _times_one_field(what, ratios)
        for what, ratios in (("with friction and conduction", with_friction), ("with conduction alone", without))
    ]


def _times_one_field(what: str, ratios: dict[str, float]) -> tuple[str, str, bool]:
    most = five_fields.TIMES_ONE_FIELD
    told = ", ".join(f"{ratio:.1f} at {n} x {n}" for n, ratio in ratios.items())
    return (f"five fields at most {most:g} times one field, {what}", told, max(ratios.values()) <= most)


OTHERS: dict[str, Callable[[Record], list[tuple[str, str, bool]]]] = {
    "half_space": _half_space,
    "half_space_friction": _friction,
    "five_fields": _five_fields,
}
