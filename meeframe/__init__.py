"""Three-dimensional frictional contact of anisotropic magneto-electro-elastic solids.

    import meeframe

    case = meeframe.Case(
        material="batio3-cofe2o4",
        mesh=meeframe.mesh.block("50 mm", "120 mm", "5 mm", divisions=8, rings=4, layers=2),
        boundary=[
            meeframe.Boundary("base", displacement=[0, 0, 0], electric_potential=0, magnetic_potential=0),
        ],
        indenter=meeframe.Sphere("100 mm"),
        contact=meeframe.IsotropicCoulomb(0.3),
        steps=[meeframe.Step(approach="20 um", increments=5)],
    )
    result = case.solve()
    result.plot.pressure()

The names below are imported when they are first used, so that `import meeframe` is quick.
"""

from importlib import import_module

TYPE_CHECKING = False  # type checkers take this name for True; to import typing would take most of the start

if TYPE_CHECKING:
    from typing import Any

    import meeframe.indenters.topography as topography
    import meeframe.mesh as mesh
    from meeframe.api.case import Case as Case
    from meeframe.api.case import run as run
    from meeframe.api.named import conductivity as conductivity
    from meeframe.api.named import formulation as formulation
    from meeframe.api.named import indenter as indenter
    from meeframe.api.named import law as law
    from meeframe.api.named import solver as solver
    from meeframe.api.named import wear as wear
    from meeframe.api.rough import rough as rough
    from meeframe.api.sweep import sweep as sweep
    from meeframe.api.tables import Base as Base
    from meeframe.api.tables import Boundary as Boundary
    from meeframe.api.tables import Contact as Contact
    from meeframe.api.tables import Interface as Interface
    from meeframe.api.tables import Layer as Layer
    from meeframe.api.tables import SecondBody as SecondBody
    from meeframe.api.tables import Step as Step
    from meeframe.common.errors import CaseError as CaseError
    from meeframe.common.errors import MeeframeError as MeeframeError
    from meeframe.formulations.dense_bem import DenseBEM as DenseBEM
    from meeframe.indenters import Cone as Cone
    from meeframe.indenters import Cylinder as Cylinder
    from meeframe.indenters import FlatPunch as FlatPunch
    from meeframe.indenters import Heights as Heights
    from meeframe.indenters import Paraboloid as Paraboloid
    from meeframe.indenters import Placement as Placement
    from meeframe.indenters import RectangularPunch as RectangularPunch
    from meeframe.indenters import SampledHeights as SampledHeights
    from meeframe.indenters import Sphere as Sphere
    from meeframe.laws import Archard as Archard
    from meeframe.laws import Insulating as Insulating
    from meeframe.laws import IsotropicCoulomb as IsotropicCoulomb
    from meeframe.laws import OrthotropicCoulomb as OrthotropicCoulomb
    from meeframe.laws import Signorini as Signorini
    from meeframe.laws import StepConductivity as StepConductivity
    from meeframe.material import Material as Material
    from meeframe.mesh import FrictionAxes as FrictionAxes
    from meeframe.mesh.body import BoundaryCondition as BoundaryCondition
    from meeframe.model.data import Output as Output
    from meeframe.model.load import load_case as load_case
    from meeframe.model.solve import solve_case as solve_case
    from meeframe.results.canvas import STYLE as STYLE
    from meeframe.results.interior import PointGrid as PointGrid
    from meeframe.results.result import Interrupted as Interrupted
    from meeframe.results.result import Result as Result
    from meeframe.results.result import read_result as read_result
    from meeframe.results.resultants import resultants as resultants
    from meeframe.solvers import Auto as Auto
    from meeframe.solvers import BarzilaiBorwein as BarzilaiBorwein
    from meeframe.solvers import Nesterov as Nesterov
    from meeframe.solvers import ProjectedCG as ProjectedCG
    from meeframe.solvers import SemismoothNewton as SemismoothNewton
    from meeframe.solvers import StoppingCriteria as StoppingCriteria
    from meeframe.solvers import Uzawa as Uzawa
    from meeframe.study.interior import interfaces as interfaces
    from meeframe.study.interior import interior as interior

__version__ = "0.1.0"

_HOMES = {
    "Case": "meeframe.api.case",
    "run": "meeframe.api.case",
    "conductivity": "meeframe.api.named",
    "formulation": "meeframe.api.named",
    "indenter": "meeframe.api.named",
    "law": "meeframe.api.named",
    "solver": "meeframe.api.named",
    "wear": "meeframe.api.named",
    "Base": "meeframe.api.tables",
    "Boundary": "meeframe.api.tables",
    "Contact": "meeframe.api.tables",
    "Interface": "meeframe.api.tables",
    "Layer": "meeframe.api.tables",
    "SecondBody": "meeframe.api.tables",
    "Step": "meeframe.api.tables",
    "rough": "meeframe.api.rough",
    "sweep": "meeframe.api.sweep",
    "CaseError": "meeframe.common.errors",
    "MeeframeError": "meeframe.common.errors",
    "DenseBEM": "meeframe.formulations.dense_bem",
    "Cone": "meeframe.indenters",
    "Cylinder": "meeframe.indenters",
    "FlatPunch": "meeframe.indenters",
    "Heights": "meeframe.indenters",
    "Paraboloid": "meeframe.indenters",
    "Placement": "meeframe.indenters",
    "RectangularPunch": "meeframe.indenters",
    "SampledHeights": "meeframe.indenters",
    "Sphere": "meeframe.indenters",
    "Archard": "meeframe.laws",
    "Insulating": "meeframe.laws",
    "IsotropicCoulomb": "meeframe.laws",
    "OrthotropicCoulomb": "meeframe.laws",
    "Signorini": "meeframe.laws",
    "StepConductivity": "meeframe.laws",
    "Material": "meeframe.material",
    "FrictionAxes": "meeframe.mesh",
    "BoundaryCondition": "meeframe.mesh.body",
    "Output": "meeframe.model.data",
    "load_case": "meeframe.model.load",
    "solve_case": "meeframe.model.solve",
    "STYLE": "meeframe.results.canvas",
    "resultants": "meeframe.results.resultants",
    "PointGrid": "meeframe.results.interior",
    "Interrupted": "meeframe.results.result",
    "Result": "meeframe.results.result",
    "read_result": "meeframe.results.result",
    "Auto": "meeframe.solvers",
    "BarzilaiBorwein": "meeframe.solvers",
    "Nesterov": "meeframe.solvers",
    "ProjectedCG": "meeframe.solvers",
    "SemismoothNewton": "meeframe.solvers",
    "StoppingCriteria": "meeframe.solvers",
    "Uzawa": "meeframe.solvers",
    "interfaces": "meeframe.study.interior",
    "interior": "meeframe.study.interior",
}

_MODULES = {"mesh": "meeframe.mesh", "topography": "meeframe.indenters.topography"}

__all__ = ["__version__", "mesh", "topography", *_HOMES]


def __getattr__(name: str) -> "Any":
    if name in _MODULES:
        return import_module(_MODULES[name])
    if name not in _HOMES:
        raise AttributeError(f"module 'meeframe' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
