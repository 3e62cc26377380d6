"""Conformance of contact laws; see meeframe.testing.contact."""

from typing import Final

import numpy as np

from meeframe.laws.base import ContactLaw, attraction, for_increment, resolve
from meeframe.testing.law_extras import check_adhesion, check_increments, check_initial_gap
from meeframe.testing.law_maps import SAMPLES, Units, check_maps
from meeframe.testing.requirements import check_frozen, close, require
from meeframe.testing.search import search_states, search_trials

_DIFFERS: Final = "differs from the reference law"


def check_contact_law(
    law: ContactLaw,
    pressure: float = 1e6,
    seed: int = 0,
    reference: ContactLaw | None = None,
    gap: float = 1e-6,
    duration: float = 1.0,
    extent: float = 1e-3,
) -> None:
    """Check all properties required by meeframe.laws.base.ContactLaw.

    `project` is pure, admissible, idempotent and local. Its tangential part is non-expansive in the metric of the law
    between trials of equal normal component; between others no friction law is, as the limit grows with the pressure.

    `resolve` is pure, local, finite, and zero where open and where there is no indenter; `project` leaves its tractions
    unchanged; the normal traction increases with its trial, and not more than the trial; solutions do not depend on the
    steps r; slip dissipates. `tangent` and `tangents` are the derivatives of the two where these exist.

    `adhesion` is pure, local, finite, >= 0, zero at infinity, continuous, and that of contact where surfaces overlap.
    It may grow with the gap, see `check_fading`. `initial_gap` is pure, local and finite.

    `for_increment` returns a contact law with all these properties, for no slip and for long slip paths; it is pure and
    local and does not depend on a duration unless the law needs one.

    Optional properties are checked separately: check_homogeneous, check_associated, check_monotone, check_isotropic,
    check_orthotropic, check_fading.

    Parameters
    ----------
    law : ContactLaw
        The contact law.
    pressure, gap, duration : float, optional
        Typical magnitudes of the random states [Pa], [m], [s]. Simple states found by hypothesis are checked, too.
    seed : int, optional
        Seed of the random states.
    reference : ContactLaw, optional
        A law that must agree in everything but the derivatives, such as a plain version of a compiled law.
    extent : float, optional
        Half width of the surface [m].

    Raises
    ------
    AssertionError
        If a property fails; the message names the property, the state and why it matters.
    """
    check_frozen(law)
    random = np.random.default_rng(seed)
    units = Units(pressure, gap, duration, extent)
    check_maps(law, lambda _: law, units, random)
    check_adhesion(law, units, random)
    check_initial_gap(law, units, random)
    check_increments(law, units, random)
    search_trials(law, pressure)
    search_states(law, units)
    if reference is not None:
        _check_equal(law, reference, units, random)


def _check_equal(law: ContactLaw, reference: ContactLaw, units: Units, random: np.random.Generator) -> None:
    """Check that two laws agree, also during increments after short and long slip paths."""
    points = units.extent * random.uniform(-1.0, 1.0, (SAMPLES, 3))
    close(law.initial_gap(points), reference.initial_gap(points), units.gap, f"initial_gap {_DIFFERS}")
    require(law.needs_duration == reference.needs_duration, f"needs_duration {_DIFFERS}", law.needs_duration)
    _check_same_maps(law, reference, units, random)
    slip_path = units.gap * 10.0 ** random.uniform(-3.0, 3.0, SAMPLES)
    for path, duration in (
        (0.0 * slip_path, units.duration),
        (slip_path, units.duration),
        (slip_path, 1e-3 * units.duration),
    ):
        step_duration = duration if law.needs_duration else None
        first, second = (for_increment(each_law, path, step_duration) for each_law in (law, reference))
        try:
            _check_same_maps(first, second, units, random)
        except AssertionError as error:
            text = f"for_increment with slip paths up to {path.max():g} m, duration {step_duration}: {error}"
            raise AssertionError(text) from None


def _check_same_maps(law: ContactLaw, reference: ContactLaw, units: Units, random: np.random.Generator) -> None:
    trial, gap = random.normal(size=(2, SAMPLES, 3))
    close(law.tangential_scaling(), reference.tangential_scaling(), 1.0, f"tangential_scaling {_DIFFERS}")
    for factor in (1e-3, 1.0, 1e3):
        trials, gaps = factor * units.pressure * trial, factor * units.gap * gap
        scale = factor * units.pressure
        close(law.project(trials), reference.project(trials), scale, f"project {_DIFFERS}")
        for r in units.lengths():
            value, expected = (resolve(each_law, trials, gaps, r) for each_law in (law, reference))
            close(value, expected, scale, f"resolve {_DIFFERS}")
        close(attraction(law, gaps[:, 2]), attraction(reference, gaps[:, 2]), units.pressure, f"adhesion {_DIFFERS}")
