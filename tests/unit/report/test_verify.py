"""The printed result of a verification states how many comparisons support it."""

import pytest
from rich.console import Console

from meeframe.contact.problem import Status
from meeframe.study.reports.verified import MeasuredQuantity, Verification, VerifiedRun
from meeframe.study.reports.verify import verification_table

SIZES = (1 / 4, 1 / 8, 1 / 16)


def verification(scatter, factor=1.0, load=1.0):
    """Return a verification with forces of second order, which agree if the factor is one, and scattering pressures.

    load: factor of all of them.
    """
    runs = tuple(
        VerifiedRun(name, size, 10, str(Status.CONVERGED), steps={1: {"force": force, "max_pressure": pressure}})
        for name, scale in (("one", 1.0), ("other", factor))
        for size, sign in zip(SIZES, (1, -1, 1), strict=True)
        for force in [MeasuredQuantity(load * scale * (1 + 0.1 * size**2), 1.0)]
        for pressure in [MeasuredQuantity(load * (1 + sign * scatter), 1.0)]
    )
    return Verification("title", "text", {}, {}, planned=len(runs), runs=runs)


def printed_result(computed):
    console = Console(width=200)
    with console.capture() as printed:
        console.print(verification_table(computed))
    return printed.get().splitlines()[-1]


@pytest.mark.parametrize(
    ("computed", "message"),
    [
        (verification(scatter=1e-4), "result: agree"),
        (
            verification(scatter=0.1),
            "result: agree: 1 of 2 comparisons agree, none disagree; the errors of 1 are too large for a conclusion, "
            "which needs finer meshes",
        ),
        (verification(scatter=0.1, factor=1.05), "result: disagree"),
        (
            verification(scatter=0.1, load=0.0),
            "result: unresolved: there is nothing to compare, as when nothing touches at the end; --every-step "
            "compares all load steps",
        ),
    ],
)
def test_result_states_the_number_of_comparisons(computed, message):
    assert printed_result(computed).rstrip() == message


@pytest.mark.parametrize(("physical", "compared"), [(0.0, True), (5.0, False), (0.5, True)])
def test_noise_is_not_compared(physical, compared):
    """Potentials near 1e-6 differ by the factor between two formulations of a possibly uncoupled field."""
    noise = {"one": 1e-6, "other": 3e-6}
    runs = tuple(
        VerifiedRun(
            name,
            size,
            10,
            str(Status.CONVERGED),
            steps={
                1: {
                    "force": MeasuredQuantity(1 + 0.1 * size**2, 1.0),
                    "max_magnetic_potential": MeasuredQuantity(value, value, physical=physical),
                }
            },
        )
        for name, value in noise.items()
        for size in SIZES
    )
    computed = Verification("title", "text", {}, {}, planned=len(runs), runs=runs)
    quantities = {estimate.quantity for estimate in computed.estimates}
    assert ("max_magnetic_potential" in quantities) == compared
    assert printed_result(computed).startswith("result: disagree" if compared else "result: agree")
