"""Three-dimensional frictional contact of anisotropic magneto-electro-elastic solids.

    import meeframe
    result = meeframe.run("case.toml", out="results")

The names below are imported when they are first used, so that `import meeframe` is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meeframe.case.case import Case as Case
    from meeframe.case.case import Output as Output
    from meeframe.case.load import load_case as load_case
    from meeframe.case.run import run as run
    from meeframe.case.solve import solve_case as solve_case
    from meeframe.case.step import Step as Step
    from meeframe.core.body import BoundaryCondition as BoundaryCondition
    from meeframe.core.errors import MeeframeError as MeeframeError
    from meeframe.core.result import Result as Result
    from meeframe.core.result import resultants as resultants
    from meeframe.io.results import read_result as read_result

__version__ = "0.1.0"

_HOMES = {
    "Case": "meeframe.case.case",
    "Output": "meeframe.case.case",
    "load_case": "meeframe.case.load",
    "run": "meeframe.case.run",
    "solve_case": "meeframe.case.solve",
    "Step": "meeframe.case.step",
    "BoundaryCondition": "meeframe.core.body",
    "MeeframeError": "meeframe.core.errors",
    "Result": "meeframe.core.result",
    "resultants": "meeframe.core.result",
    "read_result": "meeframe.io.results",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'meeframe' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
