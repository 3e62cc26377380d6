"""Registration of the built-in laws, elements, formulations and solvers through the same hooks as plugins."""

from collections.abc import Iterable

from meeframe.contact.problem import Solver
from meeframe.elements import Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.greens import Isotropic, LineIntegral, Residue, Tabulated
from meeframe.greens.base import FundamentalSolution
from meeframe.indenters import Cone, Cylinder, FlatPunch, Heights, Paraboloid, RectangularPunch, Sphere
from meeframe.indenters.base import Indenter
from meeframe.laws import Archard, Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.laws.wear import WearLaw
from meeframe.plugin.hookspecs import Record, hookimpl
from meeframe.solvers import Auto, BarzilaiBorwein, Nesterov, ProjectedCG, SemismoothNewton, Uzawa

_PAPER = "the reference paper"
_BARNETT = "Barnett, phys. stat. sol. (b) 49 (1972) 741-748"
_JOHNSON = "Johnson, Contact Mechanics (1985)"


@hookimpl
def meeframe_fundamental_solutions() -> Iterable[Record[FundamentalSolution]]:
    """Return the fundamental solutions of appendix B."""
    return [
        Record("tabulated", Tabulated, "polynomials on the sphere of directions; the default", _BARNETT),
        Record("residue", Residue, "explicit, Stroh eigenvalues of any multiplicity", f"{_PAPER}, eqs. 43-54"),
        Record("line-integral", LineIntegral, "trapezoidal rule to round-off; the reference", _BARNETT),
        Record("isotropic", Isotropic, "closed form for isotropic uncoupled media", "Kelvin (1848)"),
    ]


@hookimpl
def meeframe_elements() -> Iterable[Record[SurfaceElement]]:
    """Return the Lagrange elements."""
    lagrange = "Zienkiewicz & Taylor, The Finite Element Method"
    return [
        Record("quad4", Quad4, "quadrilateral, bilinear", lagrange),
        Record("quad8", Quad8, "quadrilateral, serendipity, quadratic", lagrange),
        Record("quad9", Quad9, "quadrilateral, biquadratic", lagrange),
        Record("tri3", Tri3, "triangle, linear", lagrange),
        Record("tri6", Tri6, "triangle, quadratic", lagrange),
    ]


@hookimpl
def meeframe_formulations() -> Iterable[Record[Formulation]]:
    """Return the boundary element formulation."""
    return [Record("dense-bem", DenseBEM, "collocation, one dense matrix", f"{_PAPER}, eqs. 19-26")]


@hookimpl
def meeframe_contact_laws() -> Iterable[Record[ContactLaw]]:
    """Return the contact laws without and with Coulomb friction."""
    return [
        Record("signorini", Signorini, "unilateral contact without friction", f"{_PAPER}, eqs. 10, 11"),
        Record("isotropic-coulomb", IsotropicCoulomb, "unilateral contact, Coulomb friction", f"{_PAPER}, eqs. 11-16"),
        Record(
            "orthotropic-coulomb",
            OrthotropicCoulomb,
            "unilateral contact, Coulomb friction with an elliptic cone",
            f"{_PAPER}, eqs. 11-16",
        ),
    ]


@hookimpl
def meeframe_conductivity_laws() -> Iterable[Record[ConductivityLaw]]:
    """Return the insulating and the conducting law."""
    return [
        Record("insulating", Insulating, "no flux through the contact", f"{_PAPER}, section 7.1 (EMII)"),
        Record("step", StepConductivity, "kappa under pressure; inf conducts perfectly", f"{_PAPER}, eqs. 17, 18"),
    ]


@hookimpl
def meeframe_wear_laws() -> Iterable[Record[WearLaw]]:
    """Return the law of Archard."""
    return [Record("archard", Archard, "depth in proportion to pressure and slip", "J. Appl. Phys. 24 (1953) 981-988")]


@hookimpl
def meeframe_solvers() -> Iterable[Record[Solver]]:
    """Return the contact solvers."""
    return [
        Record("uzawa", Uzawa, "projected augmented tractions", f"{_PAPER}, eqs. 30-32"),
        Record(
            "auto",
            Auto,
            "newton, then uzawa-nesterov, uzawa-bb and uzawa where that makes no progress",
            "docs/explanation/solvers-newton.md",
        ),
        Record("newton", SemismoothNewton, "semismooth Newton", "Christensen et al., IJNME 42 (1998) 145-173"),
        Record("uzawa-bb", BarzilaiBorwein, "uzawa, Barzilai-Borwein steps", "IMA J. Numer. Anal. 8 (1988) 141-148"),
        Record(
            "uzawa-nesterov", Nesterov, "uzawa, extrapolated and restarted", "Found. Comput. Math. 15 (2015) 715-732"
        ),
        Record("projected-cg", ProjectedCG, "conjugate gradients, no friction", "Polonsky & Keer, Wear 231 (1999) 206"),
    ]


@hookimpl
def meeframe_indenters() -> Iterable[Record[Indenter]]:
    """Return the shapes of rigid indenters."""
    return [
        Record("sphere", Sphere, "sphere or, by default, its paraboloid", f"{_JOHNSON}, section 3.4"),
        Record("paraboloid", Paraboloid, "paraboloid of two radii", f"{_JOHNSON}, section 4.2"),
        Record("flat-punch", FlatPunch, "circular flat end", f"{_JOHNSON}, section 3.8"),
        Record("rectangular-punch", RectangularPunch, "rectangular flat end", f"{_JOHNSON}, section 3.8"),
        Record("cone", Cone, "cone", "Sneddon, Int. J. Eng. Sci. 3 (1965) 47-57"),
        Record("cylinder", Cylinder, "cylinder lying on the surface", f"{_JOHNSON}, section 4.2"),
        Record("heights", Heights, "heights from a file, on a grid or at the nodes", "measured or made"),
    ]
