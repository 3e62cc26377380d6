"""Read reproduced figures and measure quantities on them."""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

_BETWEEN_MESSAGES: Final = re.compile(r"; (?!use )")
"""Between messages of a run, the first of which says that it converged; advice belongs to the message before it."""
_NUMBER: Final = re.compile(r"\d+(?:\.\d+)?")


@dataclass(frozen=True, eq=False)
class Panel:
    """One panel of a figure: quantities (runs, ...) relative to their references; points (n, 3) [m] for fields."""

    title: str
    runs: tuple[str, ...]
    values: np.ndarray
    quantities: dict[str, np.ndarray]
    points: np.ndarray
    weights: np.ndarray

    def of(self, quantity: str, run: str) -> np.ndarray:
        """Return a quantity of one run."""
        return self.quantities[quantity][self.runs.index(run)]

    def position_of_largest(self, quantity: str, run: str) -> np.ndarray:
        """Return the position of the maximum of a field, (2,) [mm], by a paraboloid through the nodes around it."""
        field = self.of(quantity, run)
        offset = self.points[:, :2] - self.points[field.argmax(), :2]
        spacing = np.diff(np.unique(np.round(self.points[:, 0], 9))).min()
        near = (np.abs(offset) < 2.5 * spacing).all(axis=1)
        x, y = (offset[near] / spacing).T
        terms = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
        _, gx, gy, xx, xy, yy = np.linalg.lstsq(terms, field[near], rcond=None)[0]
        top = np.linalg.solve([[2 * xx, xy], [xy, 2 * yy]], [-gx, -gy])
        return (self.points[field.argmax(), :2] + top * spacing) * 1e3

    def elongation(self, quantity: str, run: str) -> float:
        """Return the ratio of the widths along x and y of the region where a field exceeds half its maximum."""
        field = self.of(quantity, run)
        mass = self.weights * np.maximum(field - field.max() / 2, 0.0)
        x, y = (self.points[:, i] - (mass @ self.points[:, i]) / mass.sum() for i in range(2))
        return float(np.sqrt((mass @ x**2) / (mass @ y**2)))

    def stick_area(self, run: str) -> float:
        """Return the fraction of the contact area that sticks."""
        return float(self.weights @ self.of("stick", run) / (self.weights @ (self.of("pressure", run) > 0)))

    @property
    def one_node(self) -> float:
        """Area fraction of one inner node in the smallest contact of these runs."""
        return float(self.weights.max() / (self.quantities["pressure"] > 0).dot(self.weights).min())

    def stick_centre(self, run: str) -> float:
        """Return the centre of the stick zone along x [mm]; nan if there is none."""
        mass = self.weights * self.of("stick", run)
        return float(mass @ self.points[:, 0] / mass.sum() * 1e3) if mass.any() else float("nan")


@dataclass(frozen=True, eq=False)
class Figure:
    """A reproduced figure."""

    name: str
    title: str
    paper: str
    panels: tuple[Panel, ...]
    messages: tuple[str, ...]

    def panel(self, start: str) -> Panel:
        """Return the panel whose title starts with this text."""
        return next(panel for panel in self.panels if panel.title.startswith(start))


def _zone(panel: dict) -> tuple[np.ndarray, np.ndarray]:
    """Return points and weights of the zone of all runs of a panel; empty if there are totals only."""
    (zone,) = panel.get("zones", [{"points": [], "weights": []}])
    return np.array(zone["points"]), np.array(zone["weights"])


def read_figure(file: Path) -> Figure:
    """Read a figure written by `meeframe reproduce`. Raises RuntimeError if a run did not converge."""
    data = json.loads(file.read_text(encoding="utf-8"))
    missed = [panel["title"] for panel in data["panels"] if not all(panel["converged"])]
    if missed:
        raise RuntimeError(f"{file}: not converged: {', '.join(missed)}")
    panels = tuple(
        Panel(
            panel["title"],
            tuple(panel["runs"]),
            np.array([np.nan if value is None else value for value in panel["values"]]),
            {name: np.array(values) for name, values in panel["quantities"].items()},
            *_zone(panel),
        )
        for panel in data["panels"]
    )
    return Figure(data["name"], data["title"], data["paper"], panels, _messages(data["panels"]))


def _messages(panels: list[dict]) -> tuple[str, ...]:
    """Return the messages of the runs, one for all runs of which the messages differ in numbers only."""
    runs: dict[str, dict[str, list[str]]] = {}
    numbers: dict[str, list[list[str]]] = {}
    for panel in panels:
        for run, text in zip(panel["runs"], panel["messages"], strict=True):
            for message in _BETWEEN_MESSAGES.split(text)[1:]:
                kind = _NUMBER.sub("{}", message)
                runs.setdefault(kind, {}).setdefault(panel["title"], []).append(run)
                numbers.setdefault(kind, []).append(_NUMBER.findall(message))
    every = {panel["title"]: panel["runs"] for panel in panels}
    result = []
    for kind, by_title in runs.items():
        named = {
            title: "all" if len(of) > 1 and of == every[title] else "; ".join(of) for title, of in by_title.items()
        }
        text = kind.format(*map(_range, zip(*numbers[kind], strict=True)))
        result.append(", ".join(f"{title} ({names})" for title, names in named.items()) + f": {text}")
    return tuple(result)


def _range(values: tuple[str, ...]) -> str:
    low, high = min(values, key=float), max(values, key=float)
    return low if low == high else f"{low} to {high}"
