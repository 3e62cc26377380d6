"""Terms of contact mechanics and numerical analysis under which users look for registered names."""

from collections.abc import Collection, Mapping
from typing import Final

ALIASES: Final[Mapping[str, tuple[str, ...]]] = {
    "adhesion": ("dmt", "dugdale"),
    "jkr": ("dugdale", "dmt"),
    "maugis": ("dugdale",),
    "maugis-dugdale": ("dugdale",),
    "amontons": ("isotropic-coulomb",),
    "coulomb": ("isotropic-coulomb", "orthotropic-coulomb"),
    "friction": ("isotropic-coulomb", "orthotropic-coulomb"),
    "frictionless": ("signorini",),
    "hard": ("signorini",),
    "hertz": ("signorini", "sphere"),
    "unilateral": ("signorini",),
    "penalty": ("compliant",),
    "plasticity": ("hardness",),
    "saturated": ("hardness",),
    "shear-strength": ("tresca", "capped-coulomb"),
    "orowan": ("capped-coulomb",),
    "rate-and-state": ("rate-and-pressure",),
    "stribeck": ("rate-and-pressure",),
    "contact-resistance": ("step", "power-law", "robin"),
    "conductance": ("step", "power-law", "robin"),
    "perfect": ("step",),
    "insulated": ("insulating",),
    "tunnelling": ("across-gap",),
    "bem": ("dense-bem", "hmatrix-bem"),
    "boundary-elements": ("dense-bem", "hmatrix-bem"),
    "fem": ("skfem",),
    "finite-elements": ("skfem",),
    "fft": ("half-space",),
    "h-matrix": ("hmatrix-bem",),
    "aca": ("hmatrix-bem",),
    "cg": ("projected-cg",),
    "conjugate-gradient": ("projected-cg",),
    "active-set": ("newton",),
    "semismooth-newton": ("newton",),
    "augmented-lagrangian": ("uzawa",),
    "barzilai-borwein": ("uzawa-bb",),
    "nesterov": ("uzawa-nesterov",),
    "ball": ("sphere",),
    "berkovich": ("cone",),
    "punch": ("flat-punch", "rectangular-punch"),
    "rough": ("self-affine", "height-map"),
    "rough-surface": ("self-affine", "height-map"),
    "afm": ("height-map",),
}
"""Registered names by a term, in lower-case letters, digits and hyphens."""


def names_for(term: str, names: Collection[str]) -> list[str]:
    """Return those of the names that a term stands for.

    Parameters
    ----------
    term
        The term, in any case, with blanks, hyphens or underscores.
    names
        Names to choose from.
    """
    key = "-".join(term.lower().replace("_", " ").replace("-", " ").split())
    return [name for name in ALIASES.get(key, ()) if name in names]
