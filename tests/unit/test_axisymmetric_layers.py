"""The axisymmetric solution of contact on layers agrees with closed forms and with published and recorded numbers."""

import numpy as np
import pytest

from meeframe.fields import ELECTRIC, MAGNETIC
from meeframe.material import Material, library_material
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase
from meeframe.testing.axisymmetric_layers import AxisymmetricLayers
from meeframe.testing.closed_forms_layers import (
    column_force,
    incompressible_layer_force,
    isotropic_layer_compliance,
)

RADIUS = 10e-6
PZT = library_material("pzt-4")
GROUNDED = {ELECTRIC: 0.0, MAGNETIC: 0.0}


def isotropic(shear, nu, **keys):
    return Material.isotropic(2.0 * shear * (1.0 + nu), nu, **keys)


def on(material, layers, **keys):
    return AxisymmetricLayers(material.stiffness, layers, keys.get("potentials", {}))


@pytest.mark.parametrize("potentials", [{}, GROUNDED])
def test_homogeneous_half_space(potentials):
    """A sphere on a layer of the substrate's material, by the closed form of a half space."""
    material = library_material("batio3-cofe2o4")
    radius, approach = 0.1, 5e-5
    body = AxisymmetricLayers(material.stiffness, LayerStack((Layer(material, 1e-3),)), potentials)
    contact = body.press_sphere_by(radius, approach)
    if not potentials:  # docs/validation, Table 1
        assert contact.force == pytest.approx(23330.6, rel=3e-5)
        assert contact.radius == pytest.approx(np.sqrt(radius * approach), rel=1e-10)
        np.testing.assert_allclose(contact.centre[1:], [-4.3584e4, -47.644], rtol=3e-5)
    else:
        assert contact.force == pytest.approx(21849.6, rel=3e-5)


def test_recorded_numbers():
    """Numbers of an independent program: a BaTiO3 film of 1 um on CoFe2O4, pressed by 40 nm."""
    film = LayerStack((Layer(library_material("batio3"), 1e-6),))
    contact = on(library_material("cofe2o4"), film).press_sphere_by(RADIUS, 40e-9)
    assert contact.force == pytest.approx(5.00716788e-3, rel=3e-9)
    assert contact.radius == pytest.approx(0.634722758e-6, rel=3e-9)
    np.testing.assert_allclose(contact.centre, [-40e-9, -25.5189955, -0.0131128025], rtol=4e-9)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("xi", [0.3, 2.0])
def test_punch_on_a_slightly_different_layer(xi):
    """First-order perturbation of the modulus of the substrate and of its Poisson's ratio (Gao, Chiu and Lee, 1992)."""
    shear, nu, a, step = 8e10, 0.3, 1e-6, 1e-4
    logarithm = np.log((1.0 + xi**2) / xi**2)
    i1 = 2.0 / np.pi * np.arctan(xi) + xi / np.pi * logarithm
    i0 = 2.0 / np.pi * np.arctan(xi) + ((1.0 - 2.0 * nu) * xi * logarithm - xi / (1.0 + xi**2)) / (
        2.0 * np.pi * (1.0 - nu)
    )

    def compliance(substrate):
        layers = LayerStack((Layer(isotropic(shear, nu), xi * a),))
        return 1e-9 / on(substrate, layers).press_punch(a, 1e-9).force

    def slope(low, high):
        return (np.log(compliance(high)) - np.log(compliance(low))) / (2.0 * step)

    by_shear = slope(isotropic(shear * np.exp(-step), nu), isotropic(shear * np.exp(step), nu))
    assert by_shear == pytest.approx(-(1.0 - i0), rel=1e-6)
    by_nu = slope(isotropic(shear, nu - step), isotropic(shear, nu + step))
    assert (1.0 - nu) * by_nu == pytest.approx(-(1.0 - i1), rel=1e-6)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.499])
def test_thick_layer_on_a_rigid_base(nu):
    """The series of P / P_Hertz in sqrt(R g) / h, with coefficients integrated from the closed form of Y_33."""
    x, w = np.polynomial.legendre.leggauss(200)
    a, w = 20.0 * (1.0 + x), 20.0 * w
    deviation = 1.0 - isotropic_layer_compliance(a, (1.0, nu), None)[2, 2].real / (1.0 - nu)
    alpha, alpha_2 = w @ deviation, w @ (a**2 * deviation)
    c = 4.0 * alpha / (3.0 * np.pi)
    shear, chi, errors = 8e10, 0.1, []
    for ratio in (chi, 0.5 * chi):
        approach = (ratio * 1e-6) ** 2 / RADIUS
        computed = on(isotropic(shear, nu), LayerStack((), RigidBase(1e-6))).press_sphere_by(RADIUS, approach)
        hertz = 4.0 / 3.0 * 2.0 * shear / (1.0 - nu) * np.sqrt(RADIUS) * approach**1.5
        series = 1 + 1.5 * c * ratio + 2.625 * (c * ratio) ** 2 + (5 * c**3 - 8 * alpha_2 / (15 * np.pi)) * ratio**3
        errors.append(abs(computed.force / hertz / series - 1.0))
    assert errors[0] < 1.5 * chi**4
    assert errors[1] < 1.5 * (0.5 * chi) ** 4


@pytest.mark.parametrize("conducting", [False, True])
def test_thin_film_on_a_grounded_base(conducting):
    """A piezoelectric film under a sphere much wider than its thickness responds like independent columns."""
    h = 1e-7
    c, e, eps = PZT.elastic[2, 2, 2, 2], PZT.piezoelectric[2, 2, 2], PZT.permittivity[2, 2]
    body = AxisymmetricLayers(PZT.stiffness, LayerStack((), RigidBase(h)), GROUNDED if conducting else {})
    contact = body.press_sphere(RADIUS, 10.0 * h)
    approach = contact.approach
    if conducting:
        assert contact.force == pytest.approx(0.9880 * column_force(c, h, RADIUS, approach), rel=1e-4)
        assert contact.fluxes[ELECTRIC] == pytest.approx(-np.pi * RADIUS * approach**2 * e / h, rel=0.05)
    else:
        assert contact.force == pytest.approx(0.9932 * column_force(c + e**2 / eps, h, RADIUS, approach), rel=1e-4)
        assert contact.centre[1] == pytest.approx(-0.988 * e / eps * approach, rel=1e-3)


@pytest.mark.full
@pytest.mark.parametrize("incompressible", [False, True])
def test_thin_elastic_layer_under_a_sphere(incompressible):
    """A thin bonded layer is a bed of columns, or squeezed like a film of fluid if it is incompressible.

    The contact radius a at the approach g is given by a^2 = 2 R g for the first, and a^2 = 4 R g for the second.
    """
    shear, nu, radius, h = 8e10, 0.5 - 1e-8 if incompressible else 0.3, 0.1, 1e-6
    errors = []
    for ratio in (10.0, 20.0):
        contact = on(isotropic(shear, nu), LayerStack((), RigidBase(h))).press_sphere(radius, ratio * h)
        g = contact.approach
        if incompressible:
            force, widest = incompressible_layer_force(shear, h, radius, g), np.sqrt(4.0 * radius * g)
        else:
            modulus = 2.0 * shear * (1.0 - nu) / (1.0 - 2.0 * nu)
            force, widest = column_force(modulus, h, radius, g), np.sqrt(2.0 * radius * g)
        errors.append([abs(contact.force / force - 1.0), abs(contact.radius / widest - 1.0)])
    (coarse_force, coarse_radius), (force, radius) = errors
    assert force < 0.05
    assert force < 0.4 * coarse_force  # second order
    assert radius < 0.07
    assert radius < 0.6 * coarse_radius  # first order


@pytest.mark.full
def test_thin_piezoelectric_film_on_an_elastic_substrate():
    """The stroke of a punch per voltage at a given force has a limit that does not depend on the thickness.

    Below a contact much wider than the film the field is uniform, and the film expands by e33 / c33 per voltage. At the
    edge it pulls on the substrate with the force e31 - e33 c13 / c33 per length and voltage. Such a ring of radial
    forces moves the surface within it by (1 - 2 nu) / 2 G times this force. The deviation is of order (h / a)^(1/2).
    """
    glass, film = library_material("glass"), library_material("pzt-5h")
    c33, c13 = film.elastic[2, 2, 2, 2], film.elastic[0, 0, 2, 2]
    e33, e31 = film.piezoelectric[2, 2, 2], film.piezoelectric[2, 0, 0]
    young, nu = 70e9, 0.2
    coupling = (1.0 - 2.0 * nu) * (1.0 + nu) / young
    limit = e33 / c33 - coupling * abs(e31 - e33 * c13 / c33)
    strokes, a = [], 1e-6
    for ratio in (5.0, 10.0, 20.0):
        layers = LayerStack((Layer(film, a / ratio, Interface(electrode="grounded")),))
        grounded, driven = (
            on(glass, layers, potentials={ELECTRIC: potential}).press_punch(a, 1e-9).force for potential in (0.0, 1.0)
        )
        strokes.append(1e-9 * (grounded - driven) / grounded)
    extrapolated = (np.sqrt(2.0) * np.array(strokes[1:]) - strokes[:-1]) / (np.sqrt(2.0) - 1.0)
    errors = np.abs(extrapolated - limit) / (e33 / c33)
    assert errors[1] < 0.02
    assert errors[1] < 0.5 * errors[0]


def test_thick_film_with_a_bottom_electrode():
    """A film much thicker than the contact does not feel its bottom electrode, to the order a / h."""
    glass = library_material("glass")
    half_space = on(PZT, LayerStack((Layer(PZT, 1e-6),))).press_sphere_by(RADIUS, 1e-10)
    errors = []
    for h in (1e-6, 2e-6):
        layers = LayerStack((Layer(PZT, h, Interface(electrode="grounded")),))
        contact = on(glass, layers).press_sphere_by(RADIUS, 1e-10)
        errors.append(abs(contact.centre[1] / half_space.centre[1] - 1.0))
    assert errors[0] < 0.03
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.05)
