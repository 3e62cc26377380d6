"""Random contact problems as case files: bodies, indenters, laws, conduction, load histories and force control.

Every problem is determined by its seed. Magnitudes are chosen relative to an estimate of the pressure, so that contact
covers a part of its zone, friction both sticks and slips, and conduction matters over twelve decades.
"""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.toml import toml_text

Array = NDArray[np.float64]
Random = np.random.Generator
Table = dict[str, Any]

LIBRARY: Final = ("batio3-cofe2o4", "orthotropic-mee", "pzt-4", "linbo3", "zno", "pvdf", "silicon")
MODULUS: Final = 1e11
PERMITTIVITY: Final = 1e-9
PERMEABILITY: Final = 1e-4


@dataclass(frozen=True)
class Magnitudes:
    """Estimated magnitudes of a problem in SI units, from the width of its zone and the depth of the contact."""

    width: float
    depth: float
    radius: float
    modulus: float
    permittivity: float
    permeability: float

    @property
    def pressure(self) -> float:
        return self.modulus * self.depth / self.radius

    @property
    def force(self) -> float:
        return self.pressure * self.radius**2

    def potential(self, electric: bool) -> float:
        return self.depth * math.sqrt(self.modulus / (self.permittivity if electric else self.permeability))

    def flux(self, electric: bool) -> float:
        return self.force * math.sqrt((self.permittivity if electric else self.permeability) / self.modulus)


def draw(seed: int, folder: Path, solver: str = "auto") -> str:
    """Return the text of a random case; files that it names are written into the folder."""
    random = np.random.default_rng(seed)
    width = _power(random, -5, -1)
    radius = width * random.uniform(0.15, 0.4)
    depth = radius * _power(random, -4, -2)
    body, material, scale = _body(random, width)
    magnitudes = Magnitudes(width, depth, radius, scale["c"], scale["eps"], scale["mu"])
    law = _contact_law(random, magnitudes)
    conductivity = _conductivity(random, magnitudes)
    case: Table = {"title": f"random problem {seed}", **body, "material": material}
    if "second" in case:
        case["second_body"] = case.pop("second")
    case["indenter"] = _indenter(random, magnitudes, folder, seed)
    case["contact"] = {"law": law}
    if random.random() < 0.2:
        case["contact"]["axes"] = {"direction": [float(value) for value in random.normal(size=3)]}
    if conductivity:
        case["conductivity"] = conductivity
    case["solver"] = {"name": solver, "max_iterations": 1000, "stall_window": 120}
    case["output"] = {"figures": False, "vtu": False, "fields": ["slip", "total_slip", "slip_path"]}
    case["steps"] = _steps(random, magnitudes, law, conductivity)
    return toml_text(case)


def _power(random: Random, low: float, high: float) -> float:
    """Return a number whose decimal logarithm is uniform."""
    return float(10.0 ** random.uniform(low, high))


def _choice(random: Random, weights: Mapping[str, float]) -> str:
    names = list(weights)
    chances = np.array([weights[name] for name in names])
    return names[int(random.choice(len(names), p=chances / chances.sum()))]


def triclinic(random: Random) -> tuple[Table, dict[str, float]]:
    """Return a random admissible material without symmetry, fully coupled, and the magnitudes of its constants."""
    scale = {
        "c": MODULUS * _power(random, -3, 0.5),
        "eps": PERMITTIVITY * _power(random, -2, 1),
        "mu": PERMEABILITY * _power(random, -2, 1),
    }
    spread, coupling = random.uniform(0.0, 1.5), _choice(random, {"none": 1, "weak": 2, "strong": 4})
    share = {"none": 0.0, "weak": 0.05, "strong": 0.7}[coupling]
    elastic = scale["c"] * _positive_definite(random, 6, spread)
    fields = _positive_definite(random, 6, spread)
    units = np.sqrt([scale["eps"]] * 3 + [scale["mu"]] * 3)
    fields = fields * np.outer(units, units)
    if coupling == "none":
        fields[:3, 3:] = 0.0
    piezo = [share * math.sqrt(scale["c"] * scale[name]) * random.normal(size=(3, 6)) for name in ("eps", "mu")]
    names, components = "123456", {}
    for i in range(6):
        for j in range(i, 6):
            components[f"c_{names[i]}{names[j]}"] = elastic[i, j]
    for name, matrix in zip("eq", piezo, strict=True):
        for i in range(3):
            for j in range(6):
                components[f"{name}_{names[i]}{names[j]}"] = matrix[i, j]
    for i in range(3):
        for j in range(i, 3):
            components[f"eps_{names[i]}{names[j]}"] = fields[i, j]
            components[f"mu_{names[i]}{names[j]}"] = fields[3 + i, 3 + j]
            # lambda is symmetric as entered
            components[f"lambda_{names[i]}{names[j]}"] = 0.5 * (fields[i, 3 + j] + fields[j, 3 + i])
    values = {name: float(value) for name, value in components.items()}
    return {"name": "triclinic", "components": values}, scale


def _positive_definite(random: Random, size: int, spread: float) -> Array:
    vectors = np.linalg.qr(random.normal(size=(size, size)))[0]
    matrix: Array = (vectors * np.exp(random.uniform(-spread, spread, size))) @ vectors.T
    return 0.5 * (matrix + matrix.T)


def _material(random: Random) -> tuple[Table, dict[str, float]]:
    scale = {"c": MODULUS, "eps": PERMITTIVITY, "mu": PERMEABILITY}
    kind = _choice(random, {"triclinic": 6, "library": 3, "isotropic": 1})
    if kind == "triclinic":
        return triclinic(random)
    if kind == "isotropic":
        modulus = MODULUS * _power(random, -3, 0.5)
        ratio = float(random.choice([0.0, 0.2, 0.3, 0.45]))
        return {"name": "isotropic", "young_modulus": modulus, "poisson_ratio": ratio}, scale | {"c": modulus}
    axis = [float(value) for value in random.normal(size=3)]
    rotation = {"axis": axis, "angle": float(random.uniform(0, 3))}
    name = str(random.choice(LIBRARY))
    return ({"name": name, "rotation": rotation} if random.random() < 0.6 else {"name": name}), scale


GROUND: Final = {"group": "base", "displacement": [0, 0, 0], "electric_potential": 0, "magnetic_potential": 0}


def _body(random: Random, width: float) -> tuple[Table, Table, dict[str, float]]:
    formulation = _choice(random, {"half-space": 80, "dense-bem": 8, "skfem": 6, "hmatrix-bem": 6})
    material, scale = _material(random)
    body: Table
    if formulation == "half-space":
        body = _half_space(random, width)
    else:
        divisions = int(random.integers(3, 5))
        mesh = {"contact_width": width, "divisions": divisions, "rings": 2}
        if formulation == "dense-bem" and random.random() < 0.4:
            body = {"mesh": {"type": "half-space", **mesh}}
        else:
            mesh |= {"half_width": 4 * width, "height": 6 * width}
            body = {"mesh": {"type": "block", **mesh, "layers": 1}, "boundary": [dict(GROUND)]}
            if random.random() < 0.2:
                traction = float(scale["c"] * _power(random, -7, -5))
                body["boundary"].append({"group": "side_x+", "traction": [traction, 0, 0]})
        body["formulation"] = {"name": formulation}
        if formulation == "dense-bem":
            body["formulation"]["quadrature_tolerance"] = 1e-3
    if random.random() < 0.15:
        other, _ = _material(random)
        tables = {key: value for key, value in body.items() if key in ("mesh", "boundary", "formulation")}
        body["second"] = {"material": other, **json.loads(json.dumps(tables))}
    return body, material, scale


def _half_space(random: Random, width: float) -> Table:
    divisions = int(random.integers(4, 10))
    formulation: Table = {"name": "half-space"}
    kind = _choice(random, {"matrix": 5, "free": 2, "resolved": 2, "periodic": 1})
    if kind != "matrix":
        formulation["matrix_up_to"] = 0
    if kind == "resolved":
        formulation["edges"] = "resolved"
    elif random.random() < 0.3:
        formulation["density"] = "constant"
    if kind == "periodic":
        formulation["periodic"] = True
    return {
        "mesh": {"type": "half-space", "contact_width": width, "divisions": divisions},
        "formulation": formulation,
    }


def _indenter(random: Random, of: Magnitudes, folder: Path, seed: int) -> Table:
    curvature = of.radius**2 / of.depth
    kinds = ("sphere", "paraboloid", "cone", "cylinder", "flat-punch", "rectangular-punch", "heights", "height-map")
    name = str(random.choice(kinds))
    table: Table = {"name": name}
    if name in ("sphere", "cylinder"):
        table["radius"] = curvature
        table["profile"] = str(random.choice(["parabolic", "exact"]))
        if name == "cylinder":
            table["direction"] = float(random.uniform(0, 3))
            if random.random() < 0.5:
                table["half_length"] = of.radius * float(random.uniform(0.5, 1.5))
    elif name == "paraboloid":
        table |= {"radius_x": curvature * _power(random, -0.5, 0.5), "radius_y": curvature}
    elif name == "cone":
        table["angle"] = math.atan(of.depth / of.radius)
    elif name == "flat-punch":
        table["radius"] = of.radius
    elif name == "rectangular-punch":
        table |= {"half_width_x": of.radius, "half_width_y": of.radius * float(random.uniform(0.4, 1.0))}
    else:
        table |= _heights(random, of, folder / f"heights-{seed}.txt", name)
    if random.random() < 0.4:
        table |= {"x": float(0.1 * of.width * random.normal()), "y": float(0.1 * of.width * random.normal())}
    if name not in ("heights", "height-map") and random.random() < 0.3:
        table["rotation"] = float(random.uniform(-3, 3))
    if random.random() < 0.15:
        table["tilt_1"] = float(0.3 * of.depth / of.width * random.normal())
    return table


def _heights(random: Random, of: Magnitudes, path: Path, name: str) -> Table:
    """Write a rough sphere that covers more than the zone, as columns x, y, height."""
    side = np.linspace(-1.2 * of.width, 1.2 * of.width, 13)
    x, y = np.meshgrid(side, side)
    heights = (x**2 + y**2) * of.depth / (2 * of.radius**2) + 0.5 * of.depth * random.random(x.shape)
    table: Table = {"file": path.name, "interpolation": str(random.choice(["linear", "cubic"]))}
    if name == "height-map":
        table["facing"] = "down"
    np.savetxt(path, np.column_stack([x.ravel(), y.ravel(), heights.ravel()]))
    return table


def _contact_law(random: Random, of: Magnitudes) -> Table:
    name = str(random.choice(list(CONTACT_LAWS)))
    return {"name": name, **CONTACT_LAWS[name](random, of)}


def _mu(random: Random) -> float:
    return float(random.uniform(0.05, 0.9))


def _some_mu(random: Random) -> Table:
    kind = _choice(random, {"none": 3, "finite": 6, "stick": 1})
    return {} if kind == "none" else {"mu": _mu(random) if kind == "finite" else math.inf}


def _angle(random: Random) -> float:
    return float(random.uniform(-1.5, 1.5))


def _slip_weakening(random: Random, of: Magnitudes) -> Table:
    static = _mu(random)
    kinetic = static * float(random.uniform(0.3, 1.0))
    # stiffer surroundings than the law softens, so that slip does not jump
    distance = (static - kinetic) * of.pressure * of.width / of.modulus * _power(random, 0.3, 1.5)
    return {"mu_static": static, "mu_kinetic": kinetic, "slip_distance": max(distance, 1e-3 * of.depth)}


def _rate_and_pressure(random: Random, of: Magnitudes) -> Table:
    static = _mu(random)
    kinetic = static * float(random.uniform(0.7, 1.5))
    speed = abs(static - kinetic) * of.pressure * of.width / of.modulus * _power(random, 0.5, 1.5) / DURATION
    return {
        "mu_static": static,
        "mu_kinetic": kinetic,
        "reference_speed": max(speed, 1e-3 * of.depth),
        "speed_exponent": float(random.choice([1.0, 2.0])),
        "reference_pressure": of.pressure,
        "pressure_exponent": float(random.choice([1.0, 2 / 3])),
    }


def _dmt(random: Random, of: Magnitudes) -> Table:
    distance = of.depth * _power(random, -1, 0)
    work = float(random.uniform(0.0, 0.5)) * of.modulus * distance**2 / (6 * of.width / 5)
    return {"work_of_adhesion": work, "equilibrium_distance": distance, **_some_mu(random)}


def _dugdale(random: Random, of: Magnitudes) -> Table:
    stress = of.pressure * _power(random, -2, -0.5)
    transition = float(random.uniform(0.4, 2.0))
    # stiffer than the attraction softens over one element
    least = 3 * stress**2 / (2 * transition) * (of.width / 5) / (0.5 * of.modulus)
    return {
        "work_of_adhesion": least * _power(random, 0.1, 1),
        "adhesive_stress": stress,
        "transition": transition,
        **_some_mu(random),
    }


def _gap_waves(random: Random, of: Magnitudes) -> Table:
    return {
        "amplitude": of.depth * _power(random, -2, 0),
        "wavelength_1": of.width * float(random.uniform(0.4, 2)),
        "phase_1": _angle(random),
        **_some_mu(random),
    }


CONTACT_LAWS: Final[Mapping[str, Callable[[Random, Magnitudes], Table]]] = {
    "signorini": lambda random, of: {},
    "isotropic-coulomb": lambda random, of: {"mu": _mu(random) if random.random() < 0.85 else math.inf},
    "orthotropic-coulomb": lambda random, of: {"mu1": _mu(random), "mu2": _mu(random), "angle": _angle(random)},
    "tresca": lambda random, of: {"limit": of.pressure * _power(random, -2, 0)},
    "capped-coulomb": lambda random, of: {"mu": _mu(random), "limit": of.pressure * _power(random, -2, 0)},
    "regularised-coulomb": lambda random, of: {"mu": _mu(random), "slip_length": of.depth * _power(random, -4, 0)},
    "slip-weakening": _slip_weakening,
    "rate-and-pressure": _rate_and_pressure,
    "non-associated-coulomb": lambda random, of: {
        "mu1": _mu(random),
        "mu2": _mu(random),
        "slip_ratio": _power(random, -0.5, 0.5),
        "angle": _angle(random),
        "slip_angle": _angle(random),
    },
    "superelliptic-coulomb": lambda random, of: {
        "mu1": _mu(random),
        "mu2": _mu(random),
        "exponent": float(random.choice([1.0, 1.5, 3.0, 8.0])),
        "angle": _angle(random),
    },
    "compliant": lambda random, of: {
        "reference_pressure": of.pressure,
        "reference_closure": of.depth * _power(random, -3, 0.5),
        "exponent": float(random.uniform(0.8, 3.3)),
        **_some_mu(random),
    },
    "dmt": _dmt,
    "dmt-coulomb": lambda random, of: {"mu": _mu(random), "adhesive_pressure": of.pressure * _power(random, -3, -1)},
    "dugdale": _dugdale,
    "signorini-gap": _gap_waves,
}
DURATION: Final = 1e-2


def _conductivity(random: Random, of: Magnitudes) -> Table:
    tables: Table = {}
    for name, constant in (("electric", of.permittivity), ("magnetic", of.permeability)):
        if random.random() < 0.4:
            law = str(random.choice(list(CONDUCTIVITY_LAWS)))
            kappa = constant / of.radius * _power(random, -6, 6)
            potential = of.potential(name == "electric")
            tables[name] = {"name": law, **CONDUCTIVITY_LAWS[law](random, of, kappa, constant, potential)}
    return tables


def _across_gap(random: Random, of: Magnitudes, kappa: float, constant: float, potential: float) -> Table:
    table: Table = {"gap_constant": constant * _power(random, -3, 0)}
    if random.random() < 0.6:
        table |= {"residual_gap": of.depth * _power(random, -3, 0), "contact_conductivity": kappa}
    return table


CONDUCTIVITY_LAWS: Final[Mapping[str, Callable[[Random, Magnitudes, float, float, float], Table]]] = {
    "step": lambda random, of, kappa, constant, potential: {"kappa": kappa if random.random() < 0.7 else math.inf},
    "power-law": lambda random, of, kappa, constant, potential: {
        "reference_conductivity": kappa,
        "reference_pressure": of.pressure,
        "exponent": float(random.choice([0.5, 0.95, 2.0])),
    },
    "saturating": lambda random, of, kappa, constant, potential: {
        "largest_conductivity": kappa,
        "saturation_pressure": of.pressure * _power(random, -2, 1),
    },
    "thresholded": lambda random, of, kappa, constant, potential: {
        "contact_conductivity": kappa,
        "threshold": of.pressure * _power(random, -2, 0),
        "ramp": of.pressure * _power(random, -1, 0.5),
    },
    "across-gap": _across_gap,
    "breakdown": lambda random, of, kappa, constant, potential: {
        **_across_gap(random, of, kappa, constant, potential),
        "breakdown_field": potential / of.depth * _power(random, -1, 1),
        "breakdown_conductivity": constant / of.radius * _power(random, -2, 2),
    },
    "robin": lambda random, of, kappa, constant, potential: {"kappa": kappa},
}


def _steps(random: Random, of: Magnitudes, law: Table, conductivity: Table) -> list[Table]:
    """Return a load history: press, then shear, press again, unload, turn, or change potentials."""
    resists = law["name"] != "signorini" and law.get("mu", 1.0) > 0.0 and _has_friction(law)
    first: Table = {"approach": of.depth * float(random.uniform(0.3, 1.0))}
    if random.random() < 0.3:
        first = {"normal_force": of.force * float(random.uniform(0.2, 1.0))}
    first |= _potentials(random, of, conductivity)
    steps = [first]
    for _ in range(int(random.integers(0, 4))):
        steps.append(_later_step(random, of, steps, conductivity, _least_mu(law) if resists else 0.0))
    for step in steps:
        step["increments"] = int(random.integers(1, 4))
        if law["name"] == "rate-and-pressure":
            step["duration"] = DURATION * step["increments"]
    _float_where_insulated(steps, conductivity)
    return steps


def _float_where_insulated(steps: list[Table], conductivity: Table) -> None:
    """Replace charges and fluxes by zero where no contact conducts them, after all random numbers are drawn.

    Those are laws that insulate below a threshold of the pressure, and histories that open a contact which conducts
    only where it touches.
    """
    for name, key in (("electric", "charge"), ("magnetic", "magnetic_flux")):
        law = conductivity.get(name, {"name": ""})["name"]
        opens = any(step.get("approach", 1.0) <= 0.0 for step in steps)
        if law == "thresholded" or (opens and law not in ("across-gap", "breakdown", "robin")):
            for step in steps:
                if key in step:
                    step[key] = 0.0


def _has_friction(law: Table) -> bool:
    return "mu" in law or law["name"] not in ("compliant", "dmt", "dugdale", "signorini-gap")


def _least_mu(law: Table) -> float:
    """Return a coefficient such that forces of this ratio can be resisted; 0 if there is none."""
    if law["name"] in ("tresca", "capped-coulomb", "regularised-coulomb", "rate-and-pressure"):
        return 0.0
    if law["name"] == "slip-weakening":
        return float(law["mu_kinetic"])
    return float(min(law.get("mu", math.inf), law.get("mu1", math.inf), law.get("mu2", math.inf), 1.0))


def _later_step(random: Random, of: Magnitudes, steps: list[Table], conductivity: Table, mu: float) -> Table:
    kinds = {"shear": 4.0, "press": 1.5, "unload": 2.5, "tilt": 1.0, "twist": 1.0, "ratio": 1.5 if mu > 0 else 0.0}
    kinds["release"] = 1.0 if mu > 0 else 0.0
    kinds["potentials"] = 2.0 if conductivity else 0.0
    kind = _choice(random, kinds)
    angle = float(random.uniform(0, 2 * math.pi))
    if kind == "shear":
        return {"translation": of.depth * _power(random, -1.5, 0.7), "direction": angle}
    if kind == "press":
        return {"approach": of.depth * float(random.uniform(0.5, 1.3))}
    if kind == "unload":
        return {"approach": of.depth * float(random.choice([0.1, 0.5, -0.2]))}
    if kind == "release":
        return {"tangential_force": [0, 0], "torque": 0}
    if kind == "tilt":
        tilt = of.depth / of.width * 0.3
        return {"tilt": [float(tilt * random.normal()), 0.0]}
    if kind == "twist":
        return {"twist": float(of.depth / of.radius * random.normal())}
    if kind == "potentials":
        return _potentials(random, of, conductivity) or {"approach": of.depth}
    components = {"force_ratio": 0.6 * mu * float(random.random()), "direction": angle}
    # a ratio of no force determines nothing: press, too
    return components | {"approach": of.depth * float(random.uniform(0.5, 1.0))}


def _potentials(random: Random, of: Magnitudes, conductivity: Table) -> Table:
    table: Table = {}
    for name in conductivity:
        electric, kind = name == "electric", _choice(random, {"nothing": 2, "value": 4, "float": 2, "total": 1})
        sign = float(random.choice([-1.0, 1.0]))
        if kind == "value":
            table[f"{name}_potential"] = sign * of.potential(electric) * _power(random, -3, 0)
        elif kind in ("float", "total"):
            total = 0.0 if kind == "float" else sign * of.flux(electric) * _power(random, -5, -1)
            table["charge" if electric else "magnetic_flux"] = total
    return table
