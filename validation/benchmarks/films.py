"""Measure the cost of layers and of heat on half spaces: response and solution against those without, one thread."""

import statistics
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from common import Record, command_line, median_time, prose, table, threads
from half_space_friction import MU, SHARE, timed
from meeframe_halfspace import HalfSpace

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, PrescribedResultant
from meeframe.elements import Quad4
from meeframe.fields import MEE, FieldSet
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.layers import Layer, LayerStack
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import Auto
from meeframe.system.reduced import ReducedSystem

TITLE = "Layers and heat on half spaces"
RADIUS, FORCE, WIDTH = 0.1, 450.0, 4e-3
"""Radius of the sphere [m], its force [N], and the width of the grid [m]: the radius of the contact is about 1.2 mm."""
DEPTH, COUNT = 1e-3, 10
"""Thickness of all layers [m], and their number."""
MADE, SOLVED, QUICK = 512, 256, 64
"""Nodes along a side for responses and for solutions."""
TOLERANCE, TURNS = 1e-8, 3
MEDIA = {"transversely isotropic": None, "triclinic": rotation_about([1.0, 2.0, 3.0], 0.7)}
ANGLE = 0.3
"""Angle [rad] by which each layer is rotated further than the last one where all are different materials."""
FILMS = ("batio3", "cofe2o4")
"""Materials of the layers, alternating, on `SUBSTRATE`."""
SUBSTRATE = "batio3-cofe2o4"
Load = tuple[ContactLaw, bool]
LOADS: Mapping[str, Load] = {
    "insulated": (Signorini(), False),
    "insulated, friction": (IsotropicCoulomb(MU), False),
    "conducting": (Signorini(), True),
    "conducting, friction": (IsotropicCoulomb(MU), True),
}
TEMPERATURE, POOR = 60.0, 1e5
"""Temperature of the indenter [K], and a conductance [W/(m^2 K)] that resists as much as a fortieth of the body."""
HEAT_LOADS = {
    "insulated from heat": (Signorini(), 0.0),
    "perfect conduction of heat": (Signorini(), np.inf),
    "poor conduction of heat": (Signorini(), POOR),
    "friction, insulated from heat": (IsotropicCoulomb(MU), 0.0),
    "friction, perfect conduction of heat": (IsotropicCoulomb(MU), np.inf),
    "friction, poor conduction of heat": (IsotropicCoulomb(MU), POOR),
}
"""Contact laws and thermal conductances; both potentials are conducted perfectly."""


def sphere(
    system: ReducedSystem, law: ContactLaw, conducting: bool, fields: FieldSet = MEE, conductance: float = 0.0
) -> ContactProblem:
    """Return a sphere under a force, and half of the limit of friction if there is friction; hot if heat is a field."""
    x, y, _ = system.points.T
    modes = {2: (-1.0, FORCE)}
    if law.tangential_scaling().any():
        modes |= {0: (1.0, SHARE * MU * FORCE), 1: (1.0, 0.0)}
    prescribed = []
    for column, (sign, force) in modes.items():
        mode = np.zeros_like(system.offset)
        mode[:, column] = sign
        prescribed.append(PrescribedResultant(mode, mode, system.weights, force))
    potential: ConductivityLaw = StepConductivity(np.inf) if conducting else Insulating()
    laws = [potential, potential, StepConductivity(conductance)][: len(fields.scalars)]
    potentials = np.tile([0.0, 0.0, TEMPERATURE][: len(laws)], (len(x), 1))
    none = np.zeros((len(x), 2))
    gap = (x**2 + y**2) / (2.0 * RADIUS)
    return ContactProblem(system, law, flux_channels(*laws, fields=fields), gap, none, potentials, tuple(prescribed))


def material(name: str, rotation: Any = None) -> Material:
    """Return a material of the library, rotated if a rotation is given."""
    one = library_material(name)
    return one if rotation is None else one.rotated(rotation)


def stack(rotation: Any, angle: float = 0.0) -> LayerStack:
    """Return ten layers of two materials, each one rotated further by an angle than the last one."""
    materials = [material(FILMS[i % 2], rotation) for i in range(COUNT)]
    if angle:
        materials = [one.rotated(rotation_about([3.0, 1.0, 2.0], i * angle)) for i, one in enumerate(materials)]
    return LayerStack(tuple(Layer(one, DEPTH / COUNT) for one in materials))


def reduced(n: int, one: Material, layers: LayerStack | None = None) -> ReducedSystem:
    """Return a half space with n x n nodes."""
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH * (n - 1) / n, n - 1, 1, Quad4())
    body = Body.of(one, mesh, (), "contact", **({} if layers is None else {"layers": layers}))
    return HalfSpace(matrix_up_to=0, reference_radius=WIDTH if one.thermal_moduli is not None else None).reduce(body)


def alternately(jobs: Mapping[str, Callable[[], Record]], turns: int) -> Record:
    """Return the median processor time of each job, with what else is known of the last turn."""
    records = [{name: job() for name, job in jobs.items()} for _ in range(turns)]
    return {
        name: records[-1][name] | {"processor": statistics.median(turn[name]["processor"] for turn in records)}
        for name in jobs
    }


def made(system: Callable[[], ReducedSystem], load: Any) -> Record:
    """Measure a response from the material to the first product."""
    start = process_time()
    system().apply(load)
    return {"processor": process_time() - start}


def responses(n: int, turns: int) -> Record:
    """Measure responses of ten layers and of half spaces, with the first product."""
    load = np.random.default_rng(1).normal(size=(n * n, 5))
    media = {name: (rotation, 0.0) for name, rotation in MEDIA.items()}
    media["triclinic, all different"] = MEDIA["triclinic"], ANGLE
    result = {}
    for name, of_layers in media.items():
        one = material(SUBSTRATE, of_layers[0])
        jobs = {
            "half space": lambda one=one: made(lambda: reduced(n, one), load),
            "ten layers": lambda one=one, of_layers=of_layers: made(lambda: reduced(n, one, stack(*of_layers)), load),
        }
        result[name] = alternately(jobs, 3 * turns)  # short ones
    return result


def pressed(problem: ContactProblem) -> Record:
    """Solve a problem; its system has been used before, so that neither the response nor its inverse is counted."""
    solution, record = timed(problem, Auto(), TOLERANCE)
    return record | {"contact": int((solution.state.load[:, 2] < 0.0).sum())}


def solutions(n: int, turns: int) -> Record:
    """Measure solutions on ten layers and on half spaces of the substrate, without making the response."""
    result = {}
    for medium, rotation in MEDIA.items():
        one = material(SUBSTRATE, rotation)
        systems = {"half space": reduced(n, one), "ten layers": reduced(n, one, stack(rotation))}
        for name, load in LOADS.items():
            problems = {which: sphere(system, *load) for which, system in systems.items()}
            for problem in problems.values():
                pressed(problem)
            jobs = {which: partial(pressed, problem) for which, problem in problems.items()}
            result[f"{medium}, {name}"] = alternately(jobs, turns)
    return result


def heated(n: int, turns: int) -> Record:
    """Measure products and solutions of six fields and of five, without making the response."""
    bodies = {"five fields": library_material(SUBSTRATE), "six fields": library_material(SUBSTRATE, thermal=True)}

    def product(system: ReducedSystem) -> Record:
        load = np.random.default_rng(1).normal(size=system.offset.shape)
        return {"processor": median_time(lambda: system.apply(load), 9)["processor"]}

    systems = {name: reduced(n, one) for name, one in bodies.items()}
    result = {"product": alternately({name: partial(product, system) for name, system in systems.items()}, turns)}
    for words, (law, conductance) in HEAT_LOADS.items():
        problems = {
            name: sphere(system, law, True, bodies[name].fields, conductance) for name, system in systems.items()
        }
        for problem in problems.values():
            pressed(problem)
        result[words] = alternately({name: partial(pressed, problem) for name, problem in problems.items()}, turns)
    return result


def measure(quick: bool) -> Record:
    """Measure all comparisons, on a coarse grid if `quick`."""
    turns = 1 if quick else TURNS
    with threads(1):
        for one in (responses, solutions, heated):  # compiled, loaded
            one(32, 1)
        measures = {"responses": (responses, MADE), "solutions": (solutions, SOLVED), "heat": (heated, SOLVED)}
        sizes = {name: QUICK if quick else size for name, (_, size) in measures.items()}
        return {name: one(sizes[name], turns) for name, (one, _) in measures.items()} | {"sizes": sizes}


def _ratio(row: Record) -> float:
    """Return the ratio of the times of the second job and of the first."""
    first, second = (float(job["processor"]) for job in row.values())
    return second / first


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the largest ratios of times."""
    return [
        (f"{words}: ratio of times", f"{min(ratios):.1f} to {max(ratios):.1f}")
        for words, ratios in (
            ("ten layers against a half space, response", [_ratio(row) for row in record["responses"].values()]),
            ("ten layers against a half space, solution", [_ratio(row) for row in record["solutions"].values()]),
            ("six fields, with heat, against five, solution", _of_heat(record)),
        )
    ]


def _of_heat(record: Record) -> list[float]:
    return [_ratio(row) for name, row in record["heat"].items() if name != "product"]


def section(record: Record, _pictures: Path) -> str:
    """Return the section of the page."""
    sizes = record["sizes"]
    return "\n\n".join(
        [
            prose(
                f"Ten layers of {' and '.join(FILMS)} on {SUBSTRATE} are together as thick as the contact radius. In"
                " the triclinic case all materials are rotated alike; where all are said to be different, each is"
                f" rotated {ANGLE:g} rad more than the previous one. `auto` solves for the contact under a sphere with"
                f" a given force to a residual of {TOLERANCE:g}. Times are processor times of one thread, medians of"
                " alternating runs; those of solutions do not include the response. All grids are free, with bilinear"
                " density."
            ),
            f"### Response of ten layers, {sizes['responses']} x {sizes['responses']} nodes, first product included",
            table(
                ["medium", "half space [s]", "ten layers [s]", "ratio"],
                [_times(*one) for one in record["responses"].items()],
            ),
            f"### Solution on ten layers, {sizes['solutions']} x {sizes['solutions']} nodes",
            _solved(record["solutions"], "half space", "ten layers"),
            f"### Heat: six fields against five, {sizes['heat']} x {sizes['heat']} nodes",
            prose(
                "A conducting sphere, hot in the case of six fields, presses on a pyroelectric and pyromagnetic"
                f" material that expands. A product of six fields takes {_ratio(record['heat']['product']):.2f} times"
                " as long as one of five. Heat changes the contact and, with friction, its slip, so the numbers of"
                " steps differ."
            ),
            _solved(
                {name: row for name, row in record["heat"].items() if name != "product"}, "five fields", "six fields"
            ),
        ]
    )


def _times(name: str, row: Record) -> list[str]:
    return [name, *(f"{job['processor']:.2f}" for job in row.values()), f"{_ratio(row):.2f}"]


def _solved(rows: Record, first: str, second: str) -> str:
    heads = ["contact", f"{first} [s]", f"{second} [s]", "ratio", "steps", "products", "contact nodes"]
    counts = ("iterations", "products", "contact")
    return table(
        heads,
        [
            [*_times(name, row), *(", ".join(str(job[count]) for job in row.values()) for count in counts)]
            for name, row in rows.items()
        ],
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
