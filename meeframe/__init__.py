"""Three-dimensional frictional contact of anisotropic magneto-electro-elastic solids.

    import meeframe
    result = meeframe.run("case.toml", out="results")

The names below are imported when they are first used, so that `import meeframe` is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meeframe.common.errors import MeeframeError as MeeframeError
    from meeframe.mesh.body import BoundaryCondition as BoundaryCondition
    from meeframe.model.case import Case as Case
    from meeframe.model.data import Output as Output
    from meeframe.model.load import load_case as load_case
    from meeframe.model.solve import solve_case as solve_case
    from meeframe.model.step import Step as Step
    from meeframe.results.files import read_result as read_result
    from meeframe.results.interior import PointGrid as PointGrid
    from meeframe.results.records import Result as Result
    from meeframe.results.records import resultants as resultants
    from meeframe.study.interior import interior as interior
    from meeframe.study.run import run as run

__version__ = "0.1.0"

_HOMES = {
    "Case": "meeframe.model.case",
    "Output": "meeframe.model.data",
    "load_case": "meeframe.model.load",
    "run": "meeframe.study.run",
    "solve_case": "meeframe.model.solve",
    "Step": "meeframe.model.step",
    "BoundaryCondition": "meeframe.mesh.body",
    "MeeframeError": "meeframe.common.errors",
    "Result": "meeframe.results.records",
    "resultants": "meeframe.results.records",
    "read_result": "meeframe.results.files",
    "PointGrid": "meeframe.results.interior",
    "interior": "meeframe.study.interior",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'meeframe' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
