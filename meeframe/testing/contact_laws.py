"""Conformance of contact laws; see meeframe.testing.contact."""

from typing import Final

import numpy as np

from meeframe.laws.base import ContactLaw
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
    """Check the whole contract of meeframe.laws.base.ContactLaw. Raises AssertionError that names what fails, where,
    and why it matters.

    `project`: pure, admissible, idempotent and local; its tangential part non-expansive in the law's metric between
    trials of equal normal component (between others no friction is: the limit grows with the pressure).
    `resolve`: pure, local, finite, zero where open and where there is no indenter; `project` admits what it gives; the
    normal traction rises with its trial, and no more than that; solutions do not depend on the steps r; slip
    dissipates. `tangent`, `tangents`: the derivatives of the two where those have some.
    `adhesion`: pure, local, finite, >= 0, zero at infinity, continuous, that of contact where surfaces overlap. It may
    grow with the gap; check_fading asks that it does not. `initial_gap`: pure, local, finite.
    `for_increment`: a contact law of which all this holds, for no slip and long ways; pure and local; does not
    see a duration unless the law needs one.

    pressure [Pa], gap [m], duration [s]: magnitudes of the random states; pass some that are typical for the law.
    Beside them hypothesis looks for simple states that break it. extent: half width of the surface [m]. reference: a
    law that has to agree in all but the derivatives, as the plain one of a compiled one.
    Properties that a law need not have are checked apart: check_homogeneous, check_associated, check_monotone,
    check_isotropic, check_orthotropic, check_fading.
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
    way = units.gap * 10.0 ** random.uniform(-3.0, 3.0, SAMPLES)
    for path, duration in ((0.0 * way, units.duration), (way, units.duration), (way, 1e-3 * units.duration)):
        given = duration if law.needs_duration else None
        one, other = (whole.for_increment(path, given) for whole in (law, reference))
        try:
            _check_same_maps(one, other, units, random)
        except AssertionError as error:
            text = f"for_increment with slip paths up to {path.max():g} m, duration {given}: {error}"
            raise AssertionError(text) from None


def _check_same_maps(law: ContactLaw, reference: ContactLaw, units: Units, random: np.random.Generator) -> None:
    trial, gap = random.normal(size=(2, SAMPLES, 3))
    close(law.tangential_scaling(), reference.tangential_scaling(), 1.0, f"tangential_scaling {_DIFFERS}")
    for factor in (1e-3, 1.0, 1e3):
        pressed, moved = factor * units.pressure * trial, factor * units.gap * gap
        scale = factor * units.pressure
        close(law.project(pressed), reference.project(pressed), scale, f"project {_DIFFERS}")
        for r in units.lengths():
            found, expected = (one.resolve(pressed, moved, r) for one in (law, reference))
            close(found, expected, scale, f"resolve {_DIFFERS}")
        close(law.adhesion(moved[:, 2]), reference.adhesion(moved[:, 2]), units.pressure, f"adhesion {_DIFFERS}")
