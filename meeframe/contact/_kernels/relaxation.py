"""Compiled relaxation of nodes on a lattice, where the displacement by a load depends on the offset alone.

Only the nodes of a band take part, and their loads act on nodes a few spacings away: everything else stays unchanged.
"""

import numpy as np
from numba import njit

NORMAL = 2
"""Column of the normal displacement and traction, before those of the potentials."""
FRACTION_STEPS = 3
"""Number of secant steps for a contact fraction: the gap is nearly linear in it."""


@njit(cache=True, nogil=True)
def number_band(pressed, width, periodic, number):
    """Assign numbers to the nodes at most `width` spacings from one of the other kind, and return their count.

    pressed: (nx, ny) the two kinds; number: (nx, ny) receives the numbers, row after row, and -1 elsewhere.
    """
    nx, ny = pressed.shape
    number[:] = -1
    for i in range(nx):
        for j in range(ny):
            # the nearest node of the other kind has a neighbour of this kind
            if not (
                _differs(pressed, i, j, i - 1, j, periodic)
                or _differs(pressed, i, j, i + 1, j, periodic)
                or _differs(pressed, i, j, i, j - 1, periodic)
                or _differs(pressed, i, j, i, j + 1, periodic)
            ):
                continue
            for di in range(-width, width + 1):
                for dj in range(-width, width + 1):
                    near = di * di + dj * dj <= width * width
                    if near and _differs(pressed, i, j, i + di, j + dj, periodic):
                        number[(i + di) % nx, (j + dj) % ny] = 0
    count = 0
    for i in range(nx):
        for j in range(ny):
            if number[i, j] == 0:
                number[i, j] = count
                count += 1
    return count


@njit(cache=True, nogil=True)
def _differs(pressed, i, j, k, m, periodic):
    """Return true if the node (k, m) exists and is of another kind than (i, j)."""
    nx, ny = pressed.shape
    if not (0 <= k < nx and 0 <= m < ny):
        if not periodic:
            return False
        k, m = k % nx, m % ny
    return pressed[k, m] != pressed[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def sweep_nodes(
    number,
    positions,
    periodic,
    responses,
    conducting,
    insulating,
    slips,
    load,
    relative_displacement,
    contact_fraction,
    sweeps,
    tolerance,
):
    """Sweep back and forth over m nodes and give each the load that satisfies the laws with the other loads fixed.

    number: (nx, ny) of the nodes at their places (m, 2), -1 of the others; responses: (2 s + 1, 2 s + 1, fields,
    fields) of a node to the load of another, by the lattice offset from that to this one; conducting, insulating: (m,
    channels) transmissivities when closed and open; slips: (m,) nodes whose tangential load follows the pressure; load
    (m, fields), relative_displacement (m, fields), the displacement of the indenter relative to the body (its
    tangential part is not updated), and contact_fraction (m,) are changed; tolerance: the last sweep is the first one
    whose work is at most this fraction of that of the greatest sweep.
    """
    nx, ny = number.shape
    n_fields = load.shape[1]
    n_channels = n_fields - NORMAL - 1
    width = responses.shape[0] // 2
    self_compliance = responses[width, width]
    unloaded, change = np.empty(n_channels + 1), np.empty(n_fields)
    solution, work_space = np.empty(n_channels + 2), np.zeros((n_channels + 4, n_channels + 1))
    max_work = 0.0
    for sweep in range(sweeps):
        work = 0.0
        for count in range(len(positions)):
            node = count if sweep % 2 == 0 else len(positions) - 1 - count
            node_load = load[node]
            for row in range(n_channels + 1):
                unloaded[row] = relative_displacement[node, NORMAL + row]
                for column in range(NORMAL, n_fields):
                    unloaded[row] += self_compliance[NORMAL + row, column] * node_load[column]
            solve_node(
                unloaded,
                self_compliance,
                conducting[node],
                insulating[node],
                solution,
                work_space,
            )
            contact_fraction[node] = solution[n_channels + 1]
            for row in range(n_channels + 1):
                change[NORMAL + row] = solution[row] - node_load[NORMAL + row]
            scale = 0.0
            if solution[0] == 0.0:
                scale = -1.0
            elif slips[node] and node_load[NORMAL] < 0.0:
                scale = solution[0] / node_load[NORMAL] - 1.0
            change[0], change[1] = scale * node_load[0], scale * node_load[1]
            node_work = 0.0
            for field in range(n_fields):
                node_load[field] += change[field]
                node_work += self_compliance[field, field] * change[field] ** 2
            if node_work == 0.0:
                continue
            work += node_work
            for di in range(-width, width + 1):
                for dj in range(-width, width + 1):
                    k, m = positions[node, 0] + di, positions[node, 1] + dj
                    if periodic:
                        k, m = k % nx, m % ny
                    if 0 <= k < nx and 0 <= m < ny and number[k, m] >= 0:
                        other, response = relative_displacement[number[k, m]], responses[width + di, width + dj]
                        for row in range(NORMAL, n_fields):  # the tangential ones are not used
                            for column in range(n_fields):
                                other[row] -= response[row, column] * change[column]
        max_work = max(max_work, work)
        if work <= tolerance * max_work:
            break


@njit(cache=True, nogil=True, error_model="numpy")
def solve_node(unloaded, self_compliance, conducting, insulating, solution, work_space):
    """Compute pressure, fluxes and contact fraction of one node with the loads of all others fixed.

    unloaded: (channels + 1,) normal and potential displacement of the indenter relative to the body, without the loads
    of the node; solution: (channels + 2,) receives the result; work_space: (channels + 4, channels + 1), its last row
    zero.

    Where both states satisfy the laws, the node closes, as it does in histories of loading. Where the node would
    overlap if insulated and be apart if conducting, the contact fraction is that at which the surfaces just touch.
    """
    n_channels = len(unloaded) - 1
    equations, zeros = work_space[:n_channels], work_space[n_channels + 3]
    flux, change, partial = work_space[n_channels], work_space[n_channels + 1], work_space[n_channels + 2]
    open_gap = gap_of_fluxes(unloaded, self_compliance, insulating, 0.0, flux, equations)
    solution[0], solution[n_channels + 1] = 0.0, 0.0
    for k in range(n_channels):
        solution[1 + k] = flux[k]
    closed_gap = gap_of_fluxes(unloaded, self_compliance, conducting, 0.0, flux, equations)
    if closed_gap < 0.0:
        unit_gap = gap_of_fluxes(zeros, self_compliance, conducting, 1.0, change, equations)
        pressure = closed_gap / (self_compliance[NORMAL, NORMAL] - unit_gap)
        solution[0], solution[n_channels + 1] = pressure, 1.0
        for k in range(n_channels):
            solution[1 + k] = flux[k] + change[k] * pressure
    elif open_gap < 0.0:
        low, high, fraction = 0.0, 1.0, 0.0
        for _ in range(FRACTION_STEPS):
            fraction = low - open_gap * (high - low) / (closed_gap - open_gap)
            for k in range(n_channels):
                partial[k] = insulating[k] + fraction * (conducting[k] - insulating[k])
            gap = gap_of_fluxes(unloaded, self_compliance, partial, 0.0, flux, equations)
            if gap < 0.0:
                low, open_gap = fraction, gap
            else:
                high, closed_gap = fraction, gap
        for k in range(n_channels):
            solution[1 + k] = flux[k]
        solution[n_channels + 1] = fraction


@njit(cache=True, nogil=True, error_model="numpy")
def gap_of_fluxes(unloaded, self_compliance, transmissivity, pressure, flux, equations):
    """Fill in the fluxes of a node under a given pressure and return its gap with them.

    flux: (channels,) solves own flux = T (drop without it). The gap excludes the displacement due to the pressure
    itself. equations: scratch (channels, channels + 1). Elimination needs no pivots: rows are those of a matrix with
    positive-definite symmetric part, times T.
    """
    n = len(unloaded) - 1
    for row in range(n):
        field = NORMAL + 1 + row
        for column in range(n):
            equations[row, column] = transmissivity[row] * self_compliance[field, NORMAL + 1 + column]
        equations[row, row] = self_compliance[field, field]
        equations[row, n] = transmissivity[row] * (unloaded[1 + row] - self_compliance[field, NORMAL] * pressure)
    for pivot in range(n):
        for row in range(pivot + 1, n):
            factor = equations[row, pivot] / equations[pivot, pivot]
            for column in range(pivot, n + 1):
                equations[row, column] -= factor * equations[pivot, column]
    gap = unloaded[0]
    for row in range(n - 1, -1, -1):
        value = equations[row, n]
        for column in range(row + 1, n):
            value -= equations[row, column] * flux[column]
        flux[row] = value / equations[row, row]
        gap -= self_compliance[NORMAL, NORMAL + 1 + row] * flux[row]
    return gap


@njit(cache=True, nogil=True, error_model="numpy")
def tangential_response(number, positions, periodic, responses, load, result):
    """Set `result` (m, 2) to the tangential displacements that the loads (m, 2) of m nodes cause at these nodes.

    number: (nx, ny) of the nodes at their places (m, 2), -1 of the others; responses: (2 s + 1, 2 s + 1, 2, 2) of a
    node to the load of another, by the lattice offset from that to this one.
    """
    nx, ny = number.shape
    width = responses.shape[0] // 2
    for node in range(len(positions)):
        x = y = 0.0
        for di in range(-width, width + 1):
            for dj in range(-width, width + 1):
                k, m = positions[node, 0] - di, positions[node, 1] - dj
                if periodic:
                    k, m = k % nx, m % ny
                if 0 <= k < nx and 0 <= m < ny and number[k, m] >= 0:
                    a, b = load[number[k, m]]
                    response = responses[width + di, width + dj]
                    x += response[0, 0] * a + response[0, 1] * b
                    y += response[1, 0] * a + response[1, 1] * b
        result[node, 0], result[node, 1] = x, y
