"""Conformance of the optional methods of a reduced system, by which solvers are faster; see check_formulation."""

from itertools import product
from typing import Final

import numpy as np

from meeframe.fields import Array, Indices
from meeframe.system.reduced import ROUGH, Coarsening, ReducedSystem, Subsystem
from meeframe.testing.requirements import require
from meeframe.testing.zone_loads import ROUND_OFF, smooth_loads, typical_load, worst

CHOICES: Final = ((2,), (0, 1), (4, 1), (3, 4), (0, 1, 2), (0, 1, 2, 3, 4))
"""Fields that solvers may ask for, in any order."""
LOADED: Final = ((2,), (0, 1, 2), (4, 3), (2, 0), (4,))
"""Fields that may be loaded alone, in any order."""
ROUGHLY: Final = 0.5
"""Least cosine between a load inside the zone and the one that an approximate inverse finds of its displacement."""
INSIDE: Final = 0.4
"""Of the zone's half widths: further out approximate inverses may be bad."""
SINGLE: Final = 1e-4
"""Of a load: an approximate inverse may work in single precision."""
BOUNDS: Final = {"float64": ROUND_OFF, "float32": 1e-5}
"""Of a displacement: that of a load in single precision may be found in single precision."""
PARTS: Final = ((-0.2, 0.2), (-0.3, 0.5), (-1.0, -0.7), (-0.1, 0.1))
"""Of the zone's half widths, from where to where: parts that are asked for, one of them at a corner."""
REACHES, STENCILS = (1, 4), ((0, 1, 2, 3, 4), (2, 4))
"""Of stencils, in places, and the fields that are asked for."""
COARSELY: Final = 0.2
"""By how much a coarser division may respond otherwise to a smooth load, relative to the largest displacement."""


def check_shortcuts(system: ReducedSystem) -> None:
    """`response`, `block_response`, `rough_response`, `approximate_inverse`, `extension`, `stencil`, `coarser` and
    `within` belong to `apply`.

    Raises AssertionError.
    """
    check_response(system)
    check_block_response(system)
    check_inverse(system)
    check_extension(system)
    check_stencil(system)
    coarse = system.coarser()
    if coarse is not None:
        check_coarser(system, coarse)
    check_parts(system)


def check_response(system: ReducedSystem) -> None:
    """`response` is `apply` in the fields that are asked for, and changes nothing."""
    load = np.random.default_rng(2).normal(size=system.offset.shape) * typical_load(system)
    kept, expected = load.copy(), system.apply(load)
    for fields in CHOICES:
        found = system.response(load, fields)
        require(found.shape == (len(load), len(fields)), f"response in fields {fields} is not (n, k)", found.shape)
        error = worst(found, expected[:, list(fields)])
        require(error < ROUND_OFF, f"response in fields {fields} is not apply: another problem would be solved", error)
    require(np.array_equal(load, kept), "response changes its argument, so that solvers lose their state", len(load))


def check_block_response(system: ReducedSystem) -> None:
    """`block_response` is `apply` of a load in some fields alone, of one in single precision to about six digits;
    `rough_response` to ROUGH, and linear."""
    load = np.random.default_rng(3).normal(size=system.offset.shape) * typical_load(system)
    rough = system.rough_response()
    for loaded, fields in product(LOADED, CHOICES):
        alone, block = np.zeros_like(load), load[:, list(loaded)]
        alone[:, list(loaded)] = block
        expected = system.apply(alone)[:, list(fields)]
        for precision, bound in BOUNDS.items():
            error = worst(system.block_response(block.astype(precision), loaded, fields), expected)
            what = f"block_response to loads {precision} in fields {loaded} is not apply in fields {fields}"
            require(error < bound, f"{what}: solvers would go astray", error)
        if rough is not None:
            single = block.astype("float32")
            found = rough(single, loaded, fields)
            what = f"rough_response to loads in fields {loaded}"
            require(found.shape == expected.shape, f"{what} in fields {fields} is not (n, k)", found.shape)
            error = worst(found, expected)
            require(error < ROUGH, f"{what} is off in fields {fields}: steps would not lead where they should", error)
            error = worst(rough(-2.0 * single, loaded, fields), -2.0 * found)
            require(error < SINGLE, f"{what} is not linear: Krylov iterations would go astray", error)


def check_inverse(system: ReducedSystem) -> None:
    """`approximate_inverse` is linear and turns the displacement of a load inside the zone roughly into that load."""
    inside = np.asarray((np.abs(_place(system)) < INSIDE).all(axis=1))
    loads = np.random.default_rng(4).normal(size=(2, *system.offset.shape)) * typical_load(system) * inside[:, None]
    for fields in CHOICES:
        inverse = system.approximate_inverse(fields)
        if inverse is None:
            continue
        chosen = list(fields)
        alone = np.zeros_like(loads)
        alone[:, :, chosen] = loads[:, :, chosen]
        moved = np.array([system.apply(load)[:, chosen] for load in alone])
        kept = moved.copy()
        found = np.array([inverse(displacement) for displacement in moved])
        what = f"approximate_inverse in fields {fields}"
        fits = found.shape == moved.shape and bool(np.isfinite(found).all())
        require(fits, f"{what} gives no finite loads (n, k)", found.shape)
        require(np.array_equal(moved, kept), f"{what} changes its argument", len(moved))
        error = worst(inverse(2.0 * moved[0] - 3.0 * moved[1]), 2.0 * found[0] - 3.0 * found[1])
        require(error < SINGLE, f"{what} is not linear: Krylov iterations would go astray", error)
        unit = typical_load(system)[chosen]
        pairs = zip(found[:, inside] / unit, alone[:, inside][:, :, chosen] / unit, strict=True)
        cosine = min(float((one * other).sum() / np.sqrt((one**2).sum() * (other**2).sum())) for one, other in pairs)
        require(cosine > ROUGHLY, f"{what} gives other loads than those that caused it", cosine)


def check_extension(system: ReducedSystem) -> None:
    """`extension` keeps the values that it is given, is linear, and goes back by the adjoint map; single precision."""
    rng, count = np.random.default_rng(6), len(system.points)
    weights = system.weights / system.weights.max()
    some = rng.permutation(count)[: count // 3 + 1]
    for nodes in (np.arange(0, count, 3), np.arange(count), some, np.array([count // 2]), np.arange(0)):
        extension = system.extension(nodes)
        if extension is None:
            continue
        values, other = rng.normal(size=(2, len(nodes))).astype(np.float32)
        whole: Array = rng.normal(size=count).astype(np.float32)
        kept = values.copy(), whole.copy()
        extended, gathered = extension.extended(values), extension.gathered(whole)
        require(np.array_equal(values, kept[0]), "extension changes the values that it is given", len(nodes))
        require(np.array_equal(whole, kept[1]), "extension changes the values that it gathers", len(nodes))
        fits = extended.shape == (count,) and gathered.shape == (len(nodes),)
        require(fits, "extension gives other numbers of values than there are nodes", extended.shape)
        single = extended.dtype == gathered.dtype == np.float32
        require(single, "extension goes over to another precision, so that solvers slow down", extended.dtype)
        if not len(nodes):
            require(not extended.any(), "extension gives values that come from no node", float(np.abs(extended).max()))
            continue
        require(worst(extended[nodes], values) < SINGLE, "extension changes the values of its nodes", len(nodes))
        both = extension.extended(2.0 * values - 3.0 * other)
        error = worst(both, 2.0 * extended - 3.0 * extension.extended(other))
        require(error < SINGLE, "extension is not linear: Krylov iterations would go astray", error)
        work = float((weights * extended) @ whole), float((weights[nodes] * values) @ gathered)
        error = abs(work[0] - work[1]) / float((weights * np.abs(extended)) @ np.abs(whole))
        require(error < SINGLE, "what extension gathers is not the adjoint of what it extends", error)


def check_stencil(system: ReducedSystem) -> None:
    """`stencil` is `apply` of unit loads inside the lattice, each of whose places has a node of its own."""
    for reach, fields in zip(REACHES, STENCILS, strict=True):
        stencil = system.stencil(reach, fields)
        if stencil is None:
            continue
        lattice, size = stencil.lattice, np.array(stencil.lattice.shape)
        fits = np.array_equal(np.sort(lattice.ravel()), np.arange(len(system.points))) and (size > 2 * reach).all()
        require(bool(fits), "the lattice of a stencil has not each node once, or is too small for it", lattice.shape)
        offsets = np.indices((2 * reach + 1, 2 * reach + 1)).reshape(2, -1).T - reach
        unit = typical_load(system)
        for place in (np.array([reach, reach]), size // 2, size - 1 - reach, np.array([0, 0])):
            around = place + offsets
            inside = ((around >= 0) & (around < size)).all(axis=1) | stencil.periodic
            i, j = (around % size)[inside].T
            if not stencil.periodic and not all(1 <= at < n - 1 for at, n in zip(place, size, strict=True)):
                continue  # nodes on a border may have a smaller share of the load
            others = [field for field in range(5) if field not in fields]
            for field in range(5):
                load = np.zeros_like(system.offset)
                load[lattice[tuple(place)], field] = unit[field]
                expected = system.apply(load)[lattice[i, j]]
                expected[:, others if field in fields else slice(None)] = 0.0
                found = unit[field] * stencil.responses.reshape(-1, 5, 5)[inside, :, field]
                error = worst(found * unit, expected * unit)
                require(error < SINGLE, f"stencil to loads in field {field} at {tuple(place)} is not apply", error)


def check_coarser(system: ReducedSystem, coarse: Coarsening) -> None:
    """A coarser division has nodes of the finer one and the same offset and area, and responds nearly alike."""
    kept, there = coarse.kept, coarse.system
    distinct = len(np.unique(kept)) == len(kept) == len(there.points) < len(system.points)
    require(distinct, "kept of a coarser division is not a part of the nodes, each once", len(kept))
    for name in ("points", "frames", "offset"):
        here, expected = (part.reshape(len(kept), -1) for part in (getattr(there, name), getattr(system, name)[kept]))
        error = worst(here, expected)
        require(error < ROUND_OFF, f"{name} of a coarser division are not those of the nodes that it keeps", error)
    load = smooth_loads(there)[0] * _fading(there)[:, None]
    fine = coarse.prolong(load)
    require(fine.shape == system.offset.shape, "prolong gives no loads (n, 5)", fine.shape)
    error = worst(fine[kept], load)
    require(error < ROUND_OFF, "prolong changes values at the nodes that are kept", error)
    size = system.weights @ np.abs(fine)
    error = float((np.abs(system.weights @ fine - there.weights @ load) / size).max())
    require(error < COARSELY, "weights of a coarser division give other resultants", error)
    error = worst(there.apply(load), system.apply(fine)[kept])
    require(error < COARSELY, "a coarser division responds otherwise: a start from it would lead astray", error)


def check_parts(system: ReducedSystem) -> None:
    """Parts hold the nodes that are asked for, one after another, and respond to loads there as the whole does."""
    nodes, place = np.arange(len(system.points)), _place(system)
    single = [nodes[np.abs(place - (x, y)).sum(axis=1).argmin()][None] for x in (-1, 0, 1) for y in (-1, 0, 1)]
    for asked in (*(nodes[((place >= low) & (place <= high)).all(axis=1)] for low, high in PARTS), *single):
        part = system.within(asked)
        if part is not None:
            check_part(system, part, asked)
    require(system.within(nodes[:0]) is None, "within gives a part that holds no node", 0)


def check_part(system: ReducedSystem, part: Subsystem, asked: Indices) -> None:
    """A part holds the nodes asked for (k,), with what belongs to them, and responds there as the whole does."""
    kept, there = part.kept, part.system
    distinct = len(np.unique(kept)) == len(kept) == len(there.points) < len(system.points)
    require(distinct, "kept of a part is not a part of the nodes, each once", len(kept))
    require(bool(np.isin(asked, kept).all()), "a part does not hold the nodes that were asked for", len(kept))
    for name in ("points", "frames", "offset", "weights"):
        same = np.array_equal(getattr(there, name), getattr(system, name)[kept])
        require(same, f"{name} of a part are not those of its nodes", len(kept))
    load = np.zeros_like(system.offset)
    load[kept] = np.random.default_rng(5).normal(size=(len(kept), load.shape[1])) * typical_load(system)
    error = worst(there.apply(load[kept]), system.apply(load)[kept])
    require(error < ROUND_OFF, "a part responds otherwise than the whole: another problem would be solved", error)
    own, expected = there.diagonal_blocks(), system.diagonal_blocks()[kept]
    error = worst(own.reshape(len(kept), -1), expected.reshape(len(kept), -1))
    require(error < ROUND_OFF, "diagonal_blocks of a part are not those of its nodes", error)
    check_response(there)
    check_block_response(there)


def _fading(system: ReducedSystem) -> Array:
    """A function (n,) that is one in the middle of the zone and zero at its border."""
    shape: Array = (1.0 - _place(system) ** 2).prod(axis=1)
    return shape


def _place(system: ReducedSystem) -> Array:
    """Where nodes are along the first two axes, (n, 2), from -1 to 1."""
    low, high = system.points.min(axis=0), system.points.max(axis=0)
    place: Array = (2.0 * system.points - low - high)[:, :2] / (high - low)[:2]
    return place
