"""Numbers of Gauss points, from the singularities of the kernel in the complex plane.

Along a straight line of length l that is seen from the source with end distances r1, r2, kernels r^-p have their
singularities on the Bernstein ellipse rho = s + sqrt(s^2 - 1) with s = (r1 + r2) / l, called the spread here; n Gauss
points leave an error of order rho^-(2n - degree). A change of the normal adds another root, that of the area ratio. In
an anisotropic medium the singularities lie closer: sqrt(s^2 - 1), their distance across the line, is divided by the
anisotropy of the medium (see meeframe.elements.anisotropy). MODERATE_ANISOTROPY suits the materials of the library.
"""

from math import ceil, log, log10, sqrt

from numba import njit

MAX_ORDER = 1 << 20

MODERATE_ANISOTROPY = 1.5

_TINY = 1e-300


@njit(cache=True, nogil=True)
def order_for(spread, degree, tolerance, anisotropy):
    """Return the number of Gauss points for kernels r^-p times a polynomial.

    Parameters
    ----------
    spread : float
        Distances of the source from both ends of the line over its length, (r1 + r2) / length, >= 1.
    degree : int
        Degree of the polynomial.
    tolerance : float
        Relative error of the integral.
    anisotropy : float
        Anisotropy of the medium (`meeframe.elements.anisotropy`).

    Returns
    -------
    int
        Number of points, at most MAX_ORDER.
    """
    if spread <= 1.0 + 1e-12:
        return MAX_ORDER
    across = sqrt(spread * spread - 1.0) / anisotropy
    growth = log(sqrt(1.0 + across * across) + across)
    order = ceil(0.5 * (log(1.0 / tolerance) / growth + degree))
    return max(min(order, MAX_ORDER), degree + 1)


@njit(cache=True, nogil=True)
def required_orders(distance, size_xi, size_eta, degree, tolerance, anisotropy=MODERATE_ANISOTROPY):
    """Return the orders along xi and eta of a tensor Gauss rule over an element.

    Parameters
    ----------
    distance : float
        Distance of the source from the centre of the element.
    size_xi, size_eta : float
        Lengths of the element as of element_extents, in the unit of the distance.
    degree : int
        Degree as of shape_degree.
    tolerance : float
        Relative error of the integral.
    anisotropy : float, optional
        Anisotropy of the medium (`meeframe.elements.anisotropy`).

    Returns
    -------
    tuple of int
        Orders along xi and eta, to which the min_orders of element_extents apply too. If the source is close, they are
        large, at most MAX_ORDER, and element_rule is to be used instead.
    """
    along_xi = order_for((2.0 * distance - size_eta) / size_xi, degree, tolerance, anisotropy)
    along_eta = order_for((2.0 * distance - size_xi) / size_eta, degree, tolerance, anisotropy)
    return along_xi, along_eta


@njit(cache=True, nogil=True)
def max_points_per_direction(tolerance, gauss):
    """Return the order beyond which halving a cell is cheaper than a higher order (measured).

    Parameters
    ----------
    tolerance : float
        Relative error of the integral.
    gauss : GaussTable
        Gauss-Legendre rules, whose largest order is a bound.

    Returns
    -------
    int
        The order.
    """
    return min(gauss.points.shape[1], max(6, ceil(6.0 - 1.1 * log10(tolerance))))


@njit(cache=True, nogil=True)
def norm(x, y, z):
    """Return the Euclidean length."""
    return sqrt(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def _distance(grid, first, second):
    return norm(grid[first, 0] - grid[second, 0], grid[first, 1] - grid[second, 1], grid[first, 2] - grid[second, 2])


@njit(cache=True, nogil=True)
def _midpoint_distance(grid, first, middle, second):
    """Return the distance of a point from the midpoint of two others."""
    return norm(
        grid[middle, 0] - 0.5 * (grid[first, 0] + grid[second, 0]),
        grid[middle, 1] - 0.5 * (grid[first, 1] + grid[second, 1]),
        grid[middle, 2] - 0.5 * (grid[first, 2] + grid[second, 2]),
    )


@njit(cache=True, nogil=True)
def _segment_distance(grid, first, second):
    """Return the distance from the origin to the segment between two points."""
    ax, ay, az = grid[first, 0], grid[first, 1], grid[first, 2]
    dx, dy, dz = grid[second, 0] - ax, grid[second, 1] - ay, grid[second, 2] - az
    square = dx * dx + dy * dy + dz * dz
    t = 0.0
    if square > 0.0:
        t = min(1.0, max(0.0, -(ax * dx + ay * dy + az * dz) / square))
    return norm(ax + t * dx, ay + t * dy, az + t * dz)


@njit(cache=True, nogil=True)
def lengths_and_bulge(grid):
    """Return lengths along u and v, and deviation from a bilinear shape, of a cell on a grid (9, 3), v fastest."""
    length_u = length_v = bulge = 0.0
    for k in range(3):  # literal numbers would compile a function for each of them
        length_u = max(length_u, _distance(grid, k, k + 6))
        length_v = max(length_v, _distance(grid, 3 * k, 3 * k + 2))
        bulge = max(bulge, _midpoint_distance(grid, k, k + 3, k + 6))
        bulge = max(bulge, _midpoint_distance(grid, 3 * k, 3 * k + 1, 3 * k + 2))
    return length_u, length_v, bulge


@njit(cache=True, nogil=True)
def cell_spreads(grid, length_u, length_v, bulge):
    """Return lower bounds of the spreads along u and v of a cell seen from the origin.

    The distances of the two end lines are those of their nearest points, less the bulge of the cell. The bounds are
    exact for plane rectangles.
    """
    ends_u = ends_v = -2.0 * bulge
    for end in range(2):
        ends_u += _segment_distance(grid, 6 * end, 6 * end + 2)
        ends_v += _segment_distance(grid, 2 * end, 2 * end + 6)
    return ends_u / max(length_u, _TINY), ends_v / max(length_v, _TINY)


@njit(cache=True, nogil=True)
def skew_lengths(grid):
    """Return twice the largest distance of the centre from midpoints between the end lines of u, and of v."""
    along_u = along_v = 0.0
    centre = grid.shape[0] // 2
    for first in range(0, 3, 2):
        for second in range(0, 3, 2):
            along_u = max(along_u, _midpoint_distance(grid, first, centre, 6 + second))
            along_v = max(along_v, _midpoint_distance(grid, 3 * first, centre, 3 * second + 2))
    return 2.0 * along_u, 2.0 * along_v


@njit(cache=True, nogil=True)
def normal_spread(normals, first, second):
    """Return the spread due to the rotation of the vector Jacobian between two of the normals (m, 3)."""
    a = max(norm(normals[first, 0], normals[first, 1], normals[first, 2]), _TINY)
    b = max(norm(normals[second, 0], normals[second, 1], normals[second, 2]), _TINY)
    total = difference = 0.0
    for axis in range(3):
        one, two = normals[first, axis] / a, normals[second, axis] / b
        total += (one + two) ** 2
        difference += (one - two) ** 2
    return sqrt(1.0 + total / max(difference, 1e-20))
