"""Indentation moduli of cubic crystals agree with published ones (Vlassak and Nix 1993, 1994)."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace, indentation_modulus

from meeframe.elements import Quad4
from meeframe.material import Material, rotation_about
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.testing.half_space import indentation_problem

CONSTANTS = {"Cu": (168.4, 121.4, 75.4), "Si": (165.7, 63.9, 79.6), "Al": (107.3, 60.9, 28.3)}
MODULI = {"Cu": (134.0, 147.4, 151.6), "Si": (164.8, 172.8, 175.3), "Al": (79.0, 80.2, 80.6)}
NORMALS = {"100": (1.0, 0.0, 0.0), "110": (1.0, 1.0, 0.0), "111": (1.0, 1.0, 1.0)}


def cubic(c11, c12, c44):
    elastic = np.diag([c11, c11, c11, c44, c44, c44])
    elastic[:3, :3] += c12 * (1.0 - np.eye(3))
    none, one = np.zeros((3, 6)), np.eye(3)
    return Material.from_voigt("cubic", elastic * 1e9, none, none, 1e-10 * one, 0.0 * one, 1e-6 * one)


def align_normal(material, normal):
    """Rotate the crystal so that the normal points along x3."""
    nu = np.array(normal) / np.linalg.norm(normal)
    axis = np.cross(nu, (0.0, 0.0, 1.0))
    return material.rotated(rotation_about(axis, np.arccos(nu[2])))


@pytest.mark.parametrize("crystal", CONSTANTS)
def test_moduli_from_the_surface_compliance(crystal):
    stiffness = cubic(*CONSTANTS[crystal]).stiffness
    for normal, published in zip(NORMALS.values(), MODULI[crystal], strict=True):
        assert indentation_modulus(stiffness, normal) / 1e9 == pytest.approx(published, abs=0.06)


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("crystal", CONSTANTS)
@pytest.mark.parametrize("face", NORMALS)
def test_moduli_from_runs(crystal, face):
    """P = 4/3 M sqrt(R) g^(3/2): the published digits for circular contacts, and within 0.5 % for elliptic ones."""
    material = align_normal(cubic(*CONSTANTS[crystal]), NORMALS[face])
    radius, approach, cells = 0.1, 1e-5, 32
    spacing = 2.0 * np.sqrt(radius * approach) / cells
    mesh = half_space_mesh(1.0, 40 * spacing, 40, 1, Quad4())
    system = HalfSpace().reduce(Body(material.stiffness, mesh, (), "contact"))
    x, y, _ = system.points.T
    problem = indentation_problem(system, (x**2 + y**2) / (2.0 * radius), approach)
    solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-8))
    force = -float(system.weights @ solution.state.load[:, 2])
    modulus = 0.75 * force / (np.sqrt(radius) * approach**1.5) / 1e9
    published = MODULI[crystal][list(NORMALS).index(face)]
    assert modulus == pytest.approx(published, rel=5e-3 if face == "110" else 1.5e-3)
