"""Conformance of conductivity laws; see meeframe.testing.contact."""

from functools import partial
from typing import Final

import numpy as np

from meeframe.core.law import ConductivityLaw, contact_conductivity
from meeframe.testing.requirements import check_frozen, each, pure, require
from meeframe.testing.search import search_tractions

_SAMPLES: Final = 400


def check_conductivity_law(law: ConductivityLaw, pressure: float = 1e6, seed: int = 0) -> None:
    """Frozen; conductivity is pure, local, >= 0 and not NaN, and continuous but for a jump at zero traction."""
    check_frozen(law)
    random = np.random.default_rng(seed)
    traction = np.concatenate([-pressure * 10.0 ** random.uniform(-6, 2, _SAMPLES), [0.0, -np.finfo(float).tiny]])
    kappa = pure(partial(contact_conductivity, law), traction, "conductivity")
    require(np.shape(kappa) == traction.shape, "conductivity has another shape than the traction", np.shape(kappa))
    each(kappa >= 0.0, "conductivity is negative or NaN", traction, kappa)
    some = random.permutation(len(traction))[: _SAMPLES // 3]
    alone = contact_conductivity(law, traction[some])
    require(np.array_equal(alone, kappa[some]), "conductivity depends on other nodes", kappa)
    nearby = contact_conductivity(law, traction * (1.0 + 1e-9))
    bounded = np.isfinite(kappa)
    require(np.array_equal(bounded, np.isfinite(nearby)), "conductivity jumps to infinity under pressure", kappa)
    jump = np.abs(nearby[bounded] - kappa[bounded]) - 1e-6 * kappa[bounded]
    require(bool((jump <= 0.0).all()), "conductivity jumps under pressure", jump)
    search_tractions(law, pressure)
