"""Everything that a plugin may import from meeframe, besides `meeframe.testing` for its tests.

Contracts, records and helpers for writing laws, indenters, elements, fundamental solutions, formulations and solvers,
and the hook with which they are registered. Building blocks for formulations on surface meshes are in
`meeframe.plugin.surfaces`, those of boundary elements in `meeframe.plugin.boundary_elements`.

These names do not change between versions; all other modules may change. They are imported at their first use, so
that `import meeframe.plugin` is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meeframe.common.arguments import checked_arguments as checked_arguments
    from meeframe.common.blas import ONE_BLAS_THREAD as ONE_BLAS_THREAD
    from meeframe.common.errors import CaseError as CaseError
    from meeframe.common.errors import MaterialError as MaterialError
    from meeframe.common.errors import MeshError as MeshError
    from meeframe.common.errors import TooLargeError as TooLargeError
    from meeframe.common.files import MAX_EXPANDED_BYTES as MAX_EXPANDED_BYTES
    from meeframe.common.files import bounded_decompression as bounded_decompression
    from meeframe.common.files import check_file as check_file
    from meeframe.common.files import read_npy as read_npy
    from meeframe.common.hdf5 import open_hdf5 as open_hdf5
    from meeframe.common.memory import usable_memory as usable_memory
    from meeframe.contact.channels import FluxChannel as FluxChannel
    from meeframe.contact.conduction import Switches as Switches
    from meeframe.contact.conduction import potential_diagonal as potential_diagonal
    from meeframe.contact.conduction import resistances as resistances
    from meeframe.contact.conduction import unloaded as unloaded
    from meeframe.contact.problem import ContactProblem as ContactProblem
    from meeframe.contact.problem import ContactState as ContactState
    from meeframe.contact.problem import Iterate as Iterate
    from meeframe.contact.problem import SelectiveSolver as SelectiveSolver
    from meeframe.contact.problem import Solver as Solver
    from meeframe.contact.problem import indenter_position as indenter_position
    from meeframe.contact.problem import unbalance as unbalance
    from meeframe.elements.base import SurfaceElement as SurfaceElement
    from meeframe.fields import ELECTRIC as ELECTRIC
    from meeframe.fields import MECHANICAL as MECHANICAL
    from meeframe.fields import N_FIELDS as N_FIELDS
    from meeframe.fields import N_MECHANICAL as N_MECHANICAL
    from meeframe.fields import NORMAL as NORMAL
    from meeframe.fields import POTENTIALS as POTENTIALS
    from meeframe.fields import THERMAL_FIELD as THERMAL_FIELD
    from meeframe.fields import Array as Array
    from meeframe.fields import FieldScaling as FieldScaling
    from meeframe.fields import FieldSet as FieldSet
    from meeframe.fields import Indices as Indices
    from meeframe.fields import ScalarField as ScalarField
    from meeframe.fields.units import Quantity as Quantity
    from meeframe.fields.units import check_quantities as check_quantities
    from meeframe.formulations.base import Formulation as Formulation
    from meeframe.formulations.base import PersistentFormulation as PersistentFormulation
    from meeframe.greens._kernels.prefetch import prefetch as prefetch
    from meeframe.greens.base import FundamentalSolution as FundamentalSolution
    from meeframe.greens.base import Kernel as Kernel
    from meeframe.indenters.base import Indenter as Indenter
    from meeframe.indenters.heights import HeightGrid as HeightGrid
    from meeframe.indenters.heights import SampledHeights as SampledHeights
    from meeframe.indenters.topography import HeightMap as HeightMap
    from meeframe.indenters.topography import SampledSurface as SampledSurface
    from meeframe.indenters.topography import detrend as detrend
    from meeframe.indenters.topography import fill_missing as fill_missing
    from meeframe.indenters.topography import remove_outliers as remove_outliers
    from meeframe.laws.base import AdhesiveLaw as AdhesiveLaw
    from meeframe.laws.base import ConductivityLaw as ConductivityLaw
    from meeframe.laws.base import ContactLaw as ContactLaw
    from meeframe.laws.base import LawWithMemory as LawWithMemory
    from meeframe.laws.base import ResolventLaw as ResolventLaw
    from meeframe.laws.base import StepLengths as StepLengths
    from meeframe.laws.base import augmented_traction as augmented_traction
    from meeframe.laws.base import contact_traction as contact_traction
    from meeframe.laws.base import fixed_point_map as fixed_point_map
    from meeframe.laws.coulomb import MAX_FRICTION_RATIO as MAX_FRICTION_RATIO
    from meeframe.laws.coulomb import IsotropicCoulomb as IsotropicCoulomb
    from meeframe.laws.coulomb import OrthotropicCoulomb as OrthotropicCoulomb
    from meeframe.laws.wear import WearLaw as WearLaw
    from meeframe.material.half_space import surface_compliance as surface_compliance
    from meeframe.material.layer_fields import uniform_in_layers as uniform_in_layers
    from meeframe.material.layer_fields import wave_amplitudes as wave_amplitudes
    from meeframe.material.layer_fields import wave_fields as wave_fields
    from meeframe.material.layers import LayerStack as LayerStack
    from meeframe.material.medium import Medium as Medium
    from meeframe.material.surface_symbol import SurfaceSymbol as SurfaceSymbol
    from meeframe.material.thermal_half_space import thermal_response as thermal_response
    from meeframe.mesh.body import Body as Body
    from meeframe.mesh.body import BoundaryCondition as BoundaryCondition
    from meeframe.mesh.body import check_conditions as check_conditions
    from meeframe.mesh.regular import Cells as Cells
    from meeframe.mesh.regular import GridCells as GridCells
    from meeframe.mesh.regular import GridPoints as GridPoints
    from meeframe.mesh.surface import SurfaceMesh as SurfaceMesh
    from meeframe.mesh.zone import ContactZone as ContactZone
    from meeframe.mesh.zone import find_contact_zone as find_contact_zone
    from meeframe.mesh.zone import local_frames as local_frames
    from meeframe.plugin.hookspecs import Record as Record
    from meeframe.plugin.hookspecs import hookimpl as hookimpl
    from meeframe.system.capabilities import INTERIOR_STAGE as INTERIOR_STAGE
    from meeframe.system.capabilities import AnyArray as AnyArray
    from meeframe.system.capabilities import ApproximateInverse as ApproximateInverse
    from meeframe.system.capabilities import Coarsening as Coarsening
    from meeframe.system.capabilities import EdgeCorrection as EdgeCorrection
    from meeframe.system.capabilities import EdgeResolution as EdgeResolution
    from meeframe.system.capabilities import FieldwiseApply as FieldwiseApply
    from meeframe.system.capabilities import IndenterEdge as IndenterEdge
    from meeframe.system.capabilities import InteriorFields as InteriorFields
    from meeframe.system.capabilities import LatticeStencil as LatticeStencil
    from meeframe.system.capabilities import MaterialFlow as MaterialFlow
    from meeframe.system.capabilities import Multigrid as Multigrid
    from meeframe.system.capabilities import Persistence as Persistence
    from meeframe.system.capabilities import PointFields as PointFields
    from meeframe.system.capabilities import Prolongation as Prolongation
    from meeframe.system.capabilities import Restriction as Restriction
    from meeframe.system.capabilities import Stencil as Stencil
    from meeframe.system.capabilities import Subsystem as Subsystem
    from meeframe.system.capabilities import ZoneRecovery as ZoneRecovery
    from meeframe.system.capabilities import apply_fields as apply_fields
    from meeframe.system.capabilities import diagonal as diagonal
    from meeframe.system.capabilities import rescale_inverse as rescale_inverse
    from meeframe.system.dense import DenseSystem as DenseSystem
    from meeframe.system.dense import in_local_frames as in_local_frames
    from meeframe.system.reduced import NodalFields as NodalFields
    from meeframe.system.reduced import Progress as Progress
    from meeframe.system.reduced import ReducedSystem as ReducedSystem
    from meeframe.system.reduced import silent as silent

_HOMES = {
    # Registration
    "Record": "meeframe.plugin.hookspecs",
    "hookimpl": "meeframe.plugin.hookspecs",
    # Errors, quantities and arrays
    "checked_arguments": "meeframe.common.arguments",
    "CaseError": "meeframe.common.errors",
    "MaterialError": "meeframe.common.errors",
    "MeshError": "meeframe.common.errors",
    "TooLargeError": "meeframe.common.errors",
    "Array": "meeframe.fields",
    "ELECTRIC": "meeframe.fields",
    "FieldScaling": "meeframe.fields",
    "FieldSet": "meeframe.fields",
    "Indices": "meeframe.fields",
    "ScalarField": "meeframe.fields",
    "MECHANICAL": "meeframe.fields",
    "N_FIELDS": "meeframe.fields",
    "N_MECHANICAL": "meeframe.fields",
    "NORMAL": "meeframe.fields",
    "POTENTIALS": "meeframe.fields",
    "THERMAL_FIELD": "meeframe.fields",
    "Quantity": "meeframe.fields.units",
    "check_quantities": "meeframe.fields.units",
    # Laws
    "AdhesiveLaw": "meeframe.laws.base",
    "ConductivityLaw": "meeframe.laws.base",
    "ContactLaw": "meeframe.laws.base",
    "LawWithMemory": "meeframe.laws.base",
    "ResolventLaw": "meeframe.laws.base",
    "StepLengths": "meeframe.laws.base",
    "augmented_traction": "meeframe.laws.base",
    "contact_traction": "meeframe.laws.base",
    "fixed_point_map": "meeframe.laws.base",
    "IsotropicCoulomb": "meeframe.laws.coulomb",
    "MAX_FRICTION_RATIO": "meeframe.laws.coulomb",
    "OrthotropicCoulomb": "meeframe.laws.coulomb",
    "WearLaw": "meeframe.laws.wear",
    # Indenters
    "Indenter": "meeframe.indenters.base",
    "HeightGrid": "meeframe.indenters.heights",
    "SampledHeights": "meeframe.indenters.heights",
    # Surface topography
    "HeightMap": "meeframe.indenters.topography",
    "SampledSurface": "meeframe.indenters.topography",
    "detrend": "meeframe.indenters.topography",
    "fill_missing": "meeframe.indenters.topography",
    "remove_outliers": "meeframe.indenters.topography",
    # Elements and fundamental solutions
    "SurfaceElement": "meeframe.elements.base",
    "FundamentalSolution": "meeframe.greens.base",
    "Kernel": "meeframe.greens.base",
    # Solvers
    "ContactProblem": "meeframe.contact.problem",
    "ContactState": "meeframe.contact.problem",
    "Iterate": "meeframe.contact.problem",
    "SelectiveSolver": "meeframe.contact.problem",
    "Solver": "meeframe.contact.problem",
    "indenter_position": "meeframe.contact.problem",
    "unbalance": "meeframe.contact.problem",
    "FluxChannel": "meeframe.contact.channels",
    "Switches": "meeframe.contact.conduction",
    "potential_diagonal": "meeframe.contact.conduction",
    "resistances": "meeframe.contact.conduction",
    "unloaded": "meeframe.contact.conduction",
    # Formulations and bodies
    "Formulation": "meeframe.formulations.base",
    "PersistentFormulation": "meeframe.formulations.base",
    "surface_compliance": "meeframe.material.half_space",
    "thermal_response": "meeframe.material.thermal_half_space",
    "LayerStack": "meeframe.material.layers",
    "uniform_in_layers": "meeframe.material.layer_fields",
    "wave_amplitudes": "meeframe.material.layer_fields",
    "wave_fields": "meeframe.material.layer_fields",
    "Medium": "meeframe.material.medium",
    "SurfaceSymbol": "meeframe.material.surface_symbol",
    "Body": "meeframe.mesh.body",
    "BoundaryCondition": "meeframe.mesh.body",
    "check_conditions": "meeframe.mesh.body",
    "ContactZone": "meeframe.mesh.zone",
    "find_contact_zone": "meeframe.mesh.zone",
    "local_frames": "meeframe.mesh.zone",
    "SurfaceMesh": "meeframe.mesh.surface",
    "Cells": "meeframe.mesh.regular",
    "GridCells": "meeframe.mesh.regular",
    "GridPoints": "meeframe.mesh.regular",
    # Reduced systems
    "NodalFields": "meeframe.system.reduced",
    "Progress": "meeframe.system.reduced",
    "ReducedSystem": "meeframe.system.reduced",
    "silent": "meeframe.system.reduced",
    "DenseSystem": "meeframe.system.dense",
    "in_local_frames": "meeframe.system.dense",
    # Capabilities of reduced systems
    "AnyArray": "meeframe.system.capabilities",
    "ApproximateInverse": "meeframe.system.capabilities",
    "Coarsening": "meeframe.system.capabilities",
    "EdgeCorrection": "meeframe.system.capabilities",
    "EdgeResolution": "meeframe.system.capabilities",
    "FieldwiseApply": "meeframe.system.capabilities",
    "IndenterEdge": "meeframe.system.capabilities",
    "INTERIOR_STAGE": "meeframe.system.capabilities",
    "InteriorFields": "meeframe.system.capabilities",
    "LatticeStencil": "meeframe.system.capabilities",
    "MaterialFlow": "meeframe.system.capabilities",
    "Multigrid": "meeframe.system.capabilities",
    "Persistence": "meeframe.system.capabilities",
    "PointFields": "meeframe.system.capabilities",
    "Prolongation": "meeframe.system.capabilities",
    "Restriction": "meeframe.system.capabilities",
    "Stencil": "meeframe.system.capabilities",
    "Subsystem": "meeframe.system.capabilities",
    "ZoneRecovery": "meeframe.system.capabilities",
    "apply_fields": "meeframe.system.capabilities",
    "diagonal": "meeframe.system.capabilities",
    "rescale_inverse": "meeframe.system.capabilities",
    # Files
    "MAX_EXPANDED_BYTES": "meeframe.common.files",
    "bounded_decompression": "meeframe.common.files",
    "check_file": "meeframe.common.files",
    "open_hdf5": "meeframe.common.hdf5",
    "usable_memory": "meeframe.common.memory",
    "read_npy": "meeframe.common.files",
    # Compiled code and threads
    "ONE_BLAS_THREAD": "meeframe.common.blas",
    "prefetch": "meeframe.greens._kernels.prefetch",
}

__all__ = [*_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'meeframe.plugin' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
