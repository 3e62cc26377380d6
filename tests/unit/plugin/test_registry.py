"""The registry: isolation of broken plugins, duplicates, unknown names, tables checked against dataclass fields."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated

import numpy as np
import pytest
from pydantic import Field

from meeframe.core.errors import PluginError
from meeframe.core.indenter import Indenter
from meeframe.core.law import ConductivityLaw, ContactLaw
from meeframe.core.quantities import Quantity
from meeframe.plugin.hookspecs import Record, hookimpl
from meeframe.plugin.registry import Kind, Provider, Registry
from meeframe.plugin.validation import TableError


@dataclass(frozen=True)
class Ball(Indenter):
    radius: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    copies: int = 1
    layers: Annotated[int, Field(ge=1)] = 1

    def height(self, x, y):
        return (x**2 + y**2) / (2 * self.radius)


@dataclass(frozen=True)
class Compound(Indenter):
    first: Indenter
    second: Indenter | None = None
    weights: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self):
        if self.weights[0] < 0:
            raise ValueError("weights must not be negative")

    def height(self, x, y):
        return self.first.height(x, y)


def plugin(*records, hook="meeframe_indenters"):
    def implementation():
        return list(records)

    implementation.__name__ = hook
    return SimpleNamespace(**{hook: hookimpl(implementation)})


def record(name, factory):
    return Record(name, factory, "summary", "source")


GOOD = (Provider("good", "1.0"), plugin(record("ball", Ball), record("compound", Compound)))
REGISTRY = Registry.from_plugins([GOOD])


def problems(table):
    with pytest.raises(TableError) as caught:
        REGISTRY.create(Kind.INDENTER, table)
    return [str(problem) for problem in caught.value.problems]


def test_names_and_records():
    assert REGISTRY.names(Kind.INDENTER) == ("ball", "compound")
    assert REGISTRY.get(Kind.INDENTER, "ball").factory is Ball
    assert REGISTRY.names(Kind.SOLVER) == ()


def test_create_converts_units_and_keeps_defaults():
    ball = REGISTRY.create(Kind.INDENTER, {"name": "ball", "radius": "5 mm"})
    assert ball == Ball(pytest.approx(5e-3), 1)


def test_nested_tables_are_created_through_the_registry():
    made = REGISTRY.create(Kind.INDENTER, {"name": "compound", "first": {"name": "ball", "radius": 2}})
    assert made == Compound(Ball(2.0))
    assert REGISTRY.create(Kind.INDENTER, made) is made


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"name": "ball"}, "radius: missing key"),
        ({"name": "ball", "radius": "5 V"}, "radius = '5 V': has the wrong unit"),
        ({"name": "ball", "radius": -1}, "radius = -1: must be > 0 and finite"),
        ({"name": "ball", "radius": float("nan")}, "radius = nan: is not a number"),
        ({"name": "ball", "radius": True}, "radius = true: expected a number in m"),
        ({"name": "ball", "radius": 1, "copies": 1.5}, "copies = 1.5: should be a whole number"),
        ({"name": "ball", "radius": 1, "copies": True}, "copies = true: should be a whole number"),
        ({"name": "ball", "radius": 1, "layers": 0}, "layers = 0: should be greater than or equal to 1"),
        ({"name": "ball", "radius": 1, "layers": True}, "layers = true: should be a whole number"),
        (
            {"name": "ball", "radius": 1, "raduis": 2},
            "raduis = 2: unknown key; did you mean 'radius'? allowed: radius, copies",
        ),
        ({"name": "compound", "first": {"name": "ball", "radius": -2}}, "first.radius = -2: must be > 0"),
        ({"name": "compound", "first": "bal"}, "first.name: unknown indenter 'bal'; did you mean 'ball'?"),
        ({"name": "compound", "first": {"name": "ball", "radius": 1}, "weights": [-1, 1]}, "weights must not be"),
        ({"radius": 1}, "name: missing key; one of ball, compound"),
        ({"name": 3}, "name = 3: should be a text, one of ball, compound"),
        (7, "should be a name or a table with a name (indenter), not 7"),
    ],
)
def test_bad_tables_name_location_value_and_what_is_allowed(table, expected):
    (text,) = problems(table)
    assert expected in text


def test_all_problems_of_a_table_are_listed():
    assert len(problems({"name": "ball", "radius": "5 V", "copies": "x", "other": 1})) == 3


def test_unknown_name_lists_choices_and_broken_plugins():
    def fails():
        raise RuntimeError("no licence")

    fails.__name__ = "meeframe_contact_laws"
    broken = SimpleNamespace(
        meeframe_contact_laws=hookimpl(fails),
        meeframe_indenters=GOOD[1].meeframe_indenters,
    )
    registry = Registry.from_plugins([(Provider("bad", "0.3"), broken)])
    assert registry.names(Kind.INDENTER) == ("ball", "compound")  # its other hooks still count
    with pytest.raises(PluginError, match=r"unknown contact law 'tresca'.*plugin bad 0.3 is broken.*no licence"):
        registry.get(Kind.CONTACT_LAW, "tresca")


def misspelt_hook():
    return plugin(record("ball", Ball), hook="meeframe_indenter")


def wrong_signature():
    def meeframe_indenters(surprise):
        return []

    return SimpleNamespace(meeframe_indenters=hookimpl(meeframe_indenters))


def no_records():
    return plugin(("ball", Ball))


def exits():
    def meeframe_solvers():
        raise SystemExit(3)

    return SimpleNamespace(meeframe_solvers=hookimpl(meeframe_solvers))


@pytest.mark.parametrize("make", [misspelt_hook, wrong_signature, no_records, exits, SimpleNamespace])
def test_a_broken_plugin_is_recorded_and_leaves_the_others_alone(make):
    registry = Registry.from_plugins([(Provider("bad", "2"), make()), GOOD])
    assert registry.names(Kind.INDENTER) == ("ball", "compound")
    (broken,) = registry.broken
    assert broken.provider.name == "bad"
    assert broken.reason


def test_a_class_with_broken_annotations_fails_only_who_names_it():
    @dataclass(frozen=True)
    class Vague(Indenter):
        shape: "Nobody_knows"  # noqa: F821

        def height(self, x, y):
            return x

    registry = Registry.from_plugins([GOOD, (Provider("vague", "1"), plugin(record("vague", Vague)))])
    assert registry.create(Kind.INDENTER, {"name": "ball", "radius": 1}) == Ball(1.0)
    with pytest.raises(TableError, match=r"Vague.* cannot be used: name 'Nobody_knows' is not defined"):
        registry.create(Kind.INDENTER, {"name": "vague", "shape": 1})


def test_duplicates_raise_and_name_both_providers():
    other = (Provider("other", "2.1"), plugin(record("ball", Ball)))
    with pytest.raises(PluginError, match=r"indenter 'ball' is provided twice: by good 1.0 and by other 2.1"):
        Registry.from_plugins([GOOD, other])


def test_one_name_may_serve_two_kinds():
    @dataclass(frozen=True)
    class Law(ConductivityLaw):
        def conductivity(self, normal_traction, gap, drop):
            return np.zeros_like(normal_traction)

    other = (Provider("other", "1"), plugin(record("ball", Law), hook="meeframe_conductivity_laws"))
    registry = Registry.from_plugins([GOOD, other])
    assert registry.create(Kind.CONDUCTIVITY_LAW, "ball") == Law()
    assert registry.create(Kind.INDENTER, {"name": "ball", "radius": 1}) == Ball(1.0)
    assert not issubclass(Law, ContactLaw)
