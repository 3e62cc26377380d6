"""Test the registry: isolation of broken plugins, duplicates, unknown names, validation of tables."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated

import numpy as np
import pytest
from pydantic import Field

from meeframe.common.errors import PluginError
from meeframe.elements import Quad4
from meeframe.fields.units import Quantity
from meeframe.formulations.base import Formulation
from meeframe.indenters.base import Indenter
from meeframe.laws import Signorini
from meeframe.laws.base import ConductivityLaw, ContactLaw
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
def test_invalid_tables_name_location_value_and_allowed_values(table, expected):
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
    assert registry.names(Kind.INDENTER) == ("ball", "compound")  # its other hooks still work
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
def test_broken_plugin_does_not_affect_others(make):
    registry = Registry.from_plugins([(Provider("bad", "2"), make()), GOOD])
    assert registry.names(Kind.INDENTER) == ("ball", "compound")
    (broken,) = registry.broken
    assert broken.provider.name == "bad"
    assert broken.reason


def test_broken_annotations_affect_only_users_of_the_class():
    @dataclass(frozen=True)
    class Vague(Indenter):
        shape: "Nobody_knows"  # noqa: F821

        def height(self, x, y):
            return x

    registry = Registry.from_plugins([GOOD, (Provider("vague", "1"), plugin(record("vague", Vague)))])
    assert registry.create(Kind.INDENTER, {"name": "ball", "radius": 1}) == Ball(1.0)
    with pytest.raises(TableError, match=r"Vague.* cannot be used: name 'Nobody_knows' is not defined") as raised:
        registry.create(Kind.INDENTER, {"name": "vague", "shape": 1})
    assert isinstance(raised.value.__cause__, NameError)
    assert isinstance(raised.value.problems[0].cause, NameError), "which sweeps tell from refusals by"


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


def law_with(**methods):
    """Return a conductivity law with given methods."""
    members = {"conductivity": lambda self, normal_traction, gap, drop: 0.0 * gap, **methods}
    return dataclass(frozen=True)(type("Law", (ConductivityLaw,), members))


def registry_with(factory, *, name="law", summary="summary", source="source", hook="meeframe_conductivity_laws"):
    """Return the registry of a plugin with one record."""
    return Registry.from_plugins([(Provider("one", "1"), plugin(Record(name, factory, summary, source), hook=hook))])


@pytest.mark.parametrize(
    "method",
    [
        lambda self, normal_traction: None,
        lambda self, normal_traction, gap: None,
        lambda self, normal_traction, gap, drop, more: None,
        lambda self, normal_traction, gap, drop, *, more: None,
        lambda self, gap, normal_traction, drop: None,
        lambda self, normal_traction, drop, gap: None,
        lambda self, *, normal_traction, gap, drop: None,
        property(lambda self: None),
        3.0,
    ],
)
def test_methods_with_incompatible_signatures_are_broken(method):
    (broken,) = registry_with(law_with(conductivity=method)).broken
    assert "law 'law': Law.conductivity does not accept (normal_traction, gap, drop), which " in str(broken)


@pytest.mark.parametrize(
    "method",
    [
        lambda self, traction, _gap, _drop: None,
        lambda self, *arguments: None,
        lambda self, normal_traction, *rest: None,
        lambda self, normal_traction, gap, drop, more=1: None,
        staticmethod(lambda normal_traction, gap, drop: None),
        classmethod(lambda cls, normal_traction, gap, drop: None),
    ],
)
def test_methods_with_compatible_signatures_are_accepted(method):
    assert not registry_with(law_with(conductivity=method)).broken


def test_optional_arguments_may_be_omitted():
    """A formulation reduces with and without progress."""

    def formulation(reduce):
        members = {"check": lambda self, body: None, "reduce": reduce}
        return dataclass(frozen=True)(type("Own", (Formulation,), members))

    hook = "meeframe_formulations"
    assert not registry_with(formulation(lambda self, body, progress=None: None), hook=hook).broken
    for method in (lambda self, body, progress: None, lambda self, body: None):
        (broken,) = registry_with(formulation(method), hook=hook).broken
        assert "Own.reduce does not accept (body, progress)" in broken.reason


def test_inherited_methods_are_checked():
    members = {"for_increment": lambda self, slip_path: self}
    law = dataclass(frozen=True)(type("Old", (Signorini,), members))
    child = dataclass(frozen=True)(type("Child", (law,), {}))
    (broken,) = registry_with(child, hook="meeframe_contact_laws").broken
    assert "Child.for_increment does not accept (slip_path, duration)" in broken.reason


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"name": ""}, "conductivity law with the name ''; allowed: lower-case letters, digits and hyphens"),
        ({"name": "Law Bad Name!"}, "conductivity law with the name 'Law Bad Name!'; allowed: lower-case letters"),
        ({"name": None}, "conductivity law with the name None"),
        ({"summary": None}, "conductivity law 'law': summary = None; allowed: a non-empty text"),
        ({"source": "  "}, "conductivity law 'law': source = '  '; allowed: a non-empty text"),
        ({"factory": lambda: law_with()()}, "conductivity law 'law': its factory is <function "),
        ({"factory": 3}, "conductivity law 'law': its factory is 3; allowed: a class"),
        ({"factory": Ball}, "class Ball is not a meeframe.laws.base.ConductivityLaw"),
        ({"factory": type("Plain", (law_with(),), {})}, "class Plain is not a frozen dataclass; allowed: classes"),
    ],
)
def test_invalid_records_are_broken(changes, expected):
    registry = registry_with(**{"factory": law_with(), **changes})
    (broken,) = registry.broken
    assert expected in broken.reason
    assert not registry.entries


def test_elements_are_plain_classes():
    element = type("Own", (Quad4,), {})
    assert registry_with(element, hook="meeframe_elements").names(Kind.ELEMENT) == ("law",)
