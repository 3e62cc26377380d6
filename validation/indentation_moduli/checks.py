"""Check indentation moduli of cubic and hexagonal crystals, from the surface compliance and from runs."""

from collections.abc import Iterator

import numpy as np
from half_space import press
from meeframe_halfspace import indentation_modulus

from meeframe.fields import Array
from meeframe.material import Material, rotation_about
from meeframe.study.validate import Check, Curve, Item, Plot

TITLE = "Indentation moduli of anisotropic crystals"
SOURCE = (
    "Cubic: Vlassak and Nix, Philos. Mag. A 67 (1993) 1045 and J. Mech. Phys. Solids 42 (1994) 1223, published to four "
    "digits. Hexagonal: closed form of Elliott (1949), Delafargue and Ulm, Int. J. Solids Struct. 41 (2004) 7351."
)
CUBIC = {"Cu": (168.4, 121.4, 75.4), "Si": (165.7, 63.9, 79.6), "Al": (107.3, 60.9, 28.3)}
"""c11, c12, c44 [GPa]."""
PUBLISHED = {"Cu": (134.0, 147.4, 151.6), "Si": (164.8, 172.8, 175.3), "Al": (79.0, 80.2, 80.6)}
"""Moduli on (100), (110), (111) [GPa]."""
FACES = {"100": (1.0, 0.0, 0.0), "110": (1.0, 1.0, 0.0), "111": (1.0, 1.0, 1.0)}
HEXAGONAL = {"Zn": (161.0, 34.2, 50.1, 61.0, 38.3), "Mg": (59.7, 26.2, 21.7, 61.7, 16.4)}
"""c11, c12, c13, c33, c44 [GPa]."""
RADIUS, APPROACH, CELLS = 0.1, 1e-5, 32


def crystal(elastic: Array) -> Material:
    """Return an elastic material with a Voigt matrix (6, 6) [GPa]."""
    none, one = np.zeros((3, 6)), np.eye(3)
    return Material.from_voigt("crystal", elastic * 1e9, none, none, 1e-10 * one, 0.0 * one, 1e-6 * one)


def cubic(c11: float, c12: float, c44: float) -> Material:
    elastic = np.diag([c11, c11, c11, c44, c44, c44])
    elastic[:3, :3] += c12 * (1.0 - np.eye(3))
    return crystal(elastic)


def hexagonal(c11: float, c12: float, c13: float, c33: float, c44: float) -> Material:
    elastic = np.diag([c11, c11, c33, c44, c44, (c11 - c12) / 2.0])
    elastic[0, 1] = elastic[1, 0] = c12
    elastic[:2, 2] = elastic[2, :2] = c13
    return crystal(elastic)


def hexagonal_modulus(c11: float, c13: float, c33: float, c44: float) -> float:
    """Return the modulus on the basal plane, in the unit of the constants."""
    mean = np.sqrt(c11 * c33)
    return float(2.0 * np.sqrt((c11 * c33 - c13**2) / c11 / (1.0 / c44 + 2.0 / (mean + c13))))


def facing_up(material: Material, normal: tuple[float, float, float]) -> Material:
    """Return the material rotated so that the normal points along x3."""
    nu = np.array(normal) / np.linalg.norm(normal)
    return material.rotated(rotation_about(np.cross(nu, (0.0, 0.0, 1.0)), np.arccos(nu[2])))


def modulus_of_run(stiffness: Array) -> float:
    """Return 3 P/(4 sqrt(R) g^(3/2)) [Pa] of a sphere."""
    width = 2.0 * np.sqrt(RADIUS * APPROACH)
    result = press(stiffness, lambda x, y: (x**2 + y**2) / (2.0 * RADIUS), APPROACH, width, CELLS)
    return 0.75 * result.force / (np.sqrt(RADIUS) * APPROACH**1.5)


def run(quick: bool) -> Iterator[Item]:
    """Check every face by the surface compliance and by runs (quick: copper and zinc only)."""
    plotted: dict[str, list[float]] = {"computed": [], "published": []}
    for name, constants in CUBIC.items():
        material = cubic(*constants)
        for (face, normal), published in zip(FACES.items(), PUBLISHED[name], strict=True):
            mean = indentation_modulus(material.stiffness, normal) / 1e9
            yield Check(f"{name} ({face}), surface compliance", mean, published, 0.06, "GPa", absolute=True)
            if not quick or name == "Cu":
                # the contact on (110) is elliptic, and the mean over directions is only a first approximation
                tolerance = 5e-3 if face == "110" else 1.5e-3
                result = modulus_of_run(facing_up(material, normal).stiffness)
                yield Check(f"{name} ({face}), sphere, {CELLS} cells", result, published * 1e9, tolerance, "Pa")
            plotted["computed"].append(mean)
            plotted["published"].append(published)
    for name, (c11, c12, c13, c33, c44) in HEXAGONAL.items():
        stiffness = hexagonal(c11, c12, c13, c33, c44).stiffness
        exact = hexagonal_modulus(c11, c13, c33, c44)
        mean = indentation_modulus(stiffness) / 1e9
        yield Check(f"{name} (0001), surface compliance", mean, exact, 1e-9, "GPa")
        if not quick or name == "Zn":
            yield Check(f"{name} (0001), sphere, {CELLS} cells", modulus_of_run(stiffness), exact * 1e9, 1e-3, "Pa")
    yield _angles(7 if quick else 31)
    published = np.array(plotted["published"])
    curves = (Curve("equal", published, published), Curve("faces", published, np.array(plotted["computed"]), True))
    yield Plot("Cu, Si, Al: computed and published moduli", "published [GPa]", "computed [GPa]", curves)


def _angles(count: int) -> Plot:
    """Plot the modulus from (001) through (111) to (110)."""
    angles = np.linspace(0.0, 90.0, count)
    curves = []
    for name in ("Cu", "Si"):
        stiffness = cubic(*CUBIC[name]).stiffness
        tilts = np.deg2rad(angles)
        normals = np.column_stack([np.sin(tilts), np.sin(tilts), np.sqrt(2.0) * np.cos(tilts)])
        modulus = np.array([indentation_modulus(stiffness, tuple(n)) for n in normals]) / 1e9
        curves.append(Curve(name, angles, modulus / modulus[0]))
        places = np.rad2deg([0.0, np.arccos(1.0 / np.sqrt(3.0)), np.pi / 2.0])
        values = np.array(PUBLISHED[name])[[0, 2, 1]] / PUBLISHED[name][0]
        curves.append(Curve(f"{name}, published", places, values, points=True))
    return Plot(
        "Modulus relative to (001), normal rotated about [1-10]",
        "angle between the normal and [001] [degrees]",
        "M / M(001)",
        tuple(curves),
    )
