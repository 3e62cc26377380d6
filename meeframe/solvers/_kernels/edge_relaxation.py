"""Relaxation of nodes at the edge of a contact that conducts: pressures, fluxes and closed fractions, node by node.

Nodes lie on a lattice, and what a load causes depends on how many places away it is. Only nodes near the edge take
part, and of their loads only what these cause a few places around: everything else stays as it is.
"""

import numpy as np
from numba import njit

FRACTION_STEPS = 3
"""Secant steps for a closed fraction: the gap is nearly linear in it."""


@njit(cache=True, nogil=True)
def number_edge(pressed, reach, periodic, number):
    """Count the nodes at most `reach` spacings from one of the other kind, pressed or not, (nx, ny): how many.

    number: (nx, ny) their numbers, -1 elsewhere; one row after the other.
    """
    nx, ny = pressed.shape
    number[:] = -1
    for i in range(nx):
        for j in range(ny):
            # the nearest one of the other kind has a neighbour of this kind
            if not (
                _differs(pressed, i, j, i - 1, j, periodic)
                or _differs(pressed, i, j, i + 1, j, periodic)
                or _differs(pressed, i, j, i, j - 1, periodic)
                or _differs(pressed, i, j, i, j + 1, periodic)
            ):
                continue
            for di in range(-reach, reach + 1):
                for dj in range(-reach, reach + 1):
                    near = di * di + dj * dj <= reach * reach
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
    """Whether there is a node (k, m), and of another kind than (i, j)."""
    nx, ny = pressed.shape
    if not (0 <= k < nx and 0 <= m < ny):
        if not periodic:
            return False
        k, m = k % nx, m % ny
    return pressed[k, m] != pressed[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def relax_edge(
    number, places, periodic, responses, conducting, insulating, slips, load, ahead, contact_fraction, sweeps, settled
):
    """Sweeps to and fro over m nodes, each of which is given the load at which it satisfies the laws beside the others.

    number: (nx, ny) of the nodes at their places (m, 2), -1 of the others; responses: (2 s + 1, 2 s + 1, 5, 5) of a
    node to the load of another, by the places from that to this one; conducting, insulating: (m, 2) transmissivities
    when closed and open; slips: (m,) whose tangential load follows the pressure; load (m, 5), ahead (m, 5) of the
    indenter over the body, but for its tangential part, and closed (m,) are changed; settled: a sweep that does no more
    of the work of the greatest one is the last.
    """
    nx, ny = number.shape
    reach = responses.shape[0] // 2
    own = responses[reach, reach]
    rest, change, found = np.empty(3), np.empty(5), np.empty(4)
    first = 0.0
    for sweep in range(sweeps):
        work = 0.0
        for turn in range(len(places)):
            node = turn if sweep % 2 == 0 else len(places) - 1 - turn
            mine = load[node]
            for row in range(3):
                rest[row] = ahead[node, 2 + row]
                for column in range(2, 5):
                    rest[row] += own[2 + row, column] * mine[column]
            alone(rest, own, conducting[node], insulating[node], contact_fraction[node] == 0.0, found)
            contact_fraction[node] = found[3]
            for field in range(3):
                change[2 + field] = found[field] - mine[2 + field]
            part = 0.0
            if found[0] == 0.0:
                part = -1.0
            elif slips[node] and mine[2] < 0.0:
                part = found[0] / mine[2] - 1.0
            change[0], change[1] = part * mine[0], part * mine[1]
            done = 0.0
            for field in range(5):
                mine[field] += change[field]
                done += own[field, field] * change[field] ** 2
            if done == 0.0:
                continue
            work += done
            for di in range(-reach, reach + 1):
                for dj in range(-reach, reach + 1):
                    k, m = places[node, 0] + di, places[node, 1] + dj
                    if periodic:
                        k, m = k % nx, m % ny
                    if 0 <= k < nx and 0 <= m < ny and number[k, m] >= 0:
                        other, response = ahead[number[k, m]], responses[reach + di, reach + dj]
                        for column in range(5):
                            if change[column] != 0.0:
                                for row in range(2, 5):  # nobody asks for the others
                                    other[row] -= response[row, column] * change[column]
        first = max(first, work)
        if work <= settled * first:
            break


@njit(cache=True, nogil=True, error_model="numpy")
def alone(rest, own, conducting, insulating, opened, found):
    """Pressure, fluxes and closed fraction, found (4,), of a node ahead by `rest` (3,) without them.

    An open node that may stay open does so, since both may satisfy the laws. Where an insulated node overlaps and a
    conducting one is apart, the fraction is that at which they touch.
    """
    electric, magnetic = fluxes(rest, own, insulating, 0.0)
    apart = rest[0] - own[2, 3] * electric - own[2, 4] * magnetic
    found[0], found[1], found[2], found[3] = 0.0, electric, magnetic, 0.0
    if opened and apart >= 0.0:
        return
    electric, magnetic = fluxes(rest, own, conducting, 0.0)
    shut = rest[0] - own[2, 3] * electric - own[2, 4] * magnetic
    if shut < 0.0:
        with_electric, with_magnetic = fluxes(rest, own, conducting, 1.0)
        softness = own[2, 2] + own[2, 3] * (with_electric - electric) + own[2, 4] * (with_magnetic - magnetic)
        pressure = shut / softness
        found[0], found[3] = pressure, 1.0
        found[1] = electric + (with_electric - electric) * pressure
        found[2] = magnetic + (with_magnetic - magnetic) * pressure
    elif apart < 0.0:
        low, high, between = 0.0, 1.0, np.empty(2)
        for _ in range(FRACTION_STEPS):
            fraction = low - apart * (high - low) / (shut - apart)
            for k in range(2):
                between[k] = insulating[k] + fraction * (conducting[k] - insulating[k])
            electric, magnetic = fluxes(rest, own, between, 0.0)
            gap = rest[0] - own[2, 3] * electric - own[2, 4] * magnetic
            if gap < 0.0:
                low, apart = fraction, gap
            else:
                high, shut = fraction, gap
        found[1], found[2], found[3] = electric, magnetic, fraction


@njit(cache=True, nogil=True, error_model="numpy")
def fluxes(rest, own, transmissivity, pressure):
    """Both fluxes of a node under a pressure: own flux = T (drop without this flux)."""
    first = transmissivity[0] * (rest[1] - own[3, 2] * pressure)
    second = transmissivity[1] * (rest[2] - own[4, 2] * pressure)
    a, b = own[3, 3], transmissivity[0] * own[3, 4]
    c, d = transmissivity[1] * own[4, 3], own[4, 4]
    determinant = a * d - b * c
    return (first * d - b * second) / determinant, (a * second - c * first) / determinant
