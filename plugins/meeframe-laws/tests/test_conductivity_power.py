import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meeframe_laws import PowerLaw

from meeframe.common.errors import CaseError
from meeframe.laws.base import contact_conductivity
from meeframe.plugin.registry import Kind, load

LAW = PowerLaw(reference_conductivity=2.0e-3, reference_pressure=1.0e6)


def test_values_at_reference_and_where_open():
    kappa = contact_conductivity(LAW, np.array([-1.0e6, 0.0, 5.0]))
    np.testing.assert_allclose(kappa, [2.0e-3, 0.0, 0.0], rtol=1e-14)


@settings(deadline=None, max_examples=50)
@given(st.floats(1e-3, 1e12), st.floats(1.001, 1e3), st.floats(0.1, 3.0))
def test_law_is_homogeneous_and_increasing(pressure, factor, exponent):
    law = PowerLaw(2.0e-3, 1.0e6, exponent)
    first, second = contact_conductivity(law, np.array([-pressure, -factor * pressure]))
    assert second > first > 0
    assert second / first == pytest.approx(factor**exponent, rel=1e-10)


def test_registration_and_table():
    entry = next(entry for entry in load().entries if entry.record.name == "power-law")
    assert entry.provider.name == "meeframe-laws"
    law = load().create(
        Kind.CONDUCTIVITY_LAW,
        {"name": "power-law", "reference_conductivity": "2 mF/m^2", "reference_pressure": "1 MPa"},
    )
    assert (law.reference_conductivity, law.reference_pressure, law.exponent) == pytest.approx((2e-3, 1e6, 0.95))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("reference_conductivity", -1.0),
        ("reference_pressure", 0.0),
        ("reference_pressure", "1 V"),
        ("exponent", float("nan")),
    ],
)
def test_invalid_values_name_their_key(key, value):
    table = {"name": "power-law", "reference_conductivity": 1.0, "reference_pressure": 1.0, key: value}
    with pytest.raises(CaseError, match=key):
        load().create(Kind.CONDUCTIVITY_LAW, table)
    with pytest.raises(CaseError, match=key):
        PowerLaw(**{k: v for k, v in table.items() if k != "name"})
