"""Closed forms of wear by Archard's law, dw/ds = k p, under a rigid indenter on an isotropic elastic half space.

k [1/Pa] is the wear coefficient over the hardness, E* [Pa] the plane-strain modulus, s [m] the length of the slip.

References
----------
Galin, J. Appl. Math. Mech. 40 (1976) 981; Goryacheva, Contact Mechanics in Tribology (1998), chapters 6 and 7; Popov,
Sci. Rep. 4 (2014) 3749 for fretting.
"""

import math
from typing import Final

FLAT_PUNCH_MODE: Final = 0.485283773
"""Largest m with (1/pi) integral of q(y)/|x - y| dA + const = m q(x) and integral of q = 0 on the unit disc."""


def flat_punch_decay(coefficient: float, modulus: float, radius: float) -> float:
    """Return the rate k E*/(a m) [1/m] at which the pressure of a flat punch under a held force becomes uniform."""
    return coefficient * modulus / (radius * FLAT_PUNCH_MODE)


def scar_radius(coefficient: float, force: float, radius: float, slip: float) -> float:
    """Return the radius a [m] of the scar of a sphere, a^4 = 4 k P R s/pi, far deeper than its elastic approach."""
    return float((4.0 * coefficient * force * radius * slip / math.pi) ** 0.25)


def fretting_force(modulus: float, radius: float, depth: float, stick_radius: float) -> float:
    """Return the force [N] of a sphere at a held approach [m] whose slip annulus has worn until it bears nothing.

    The zone within the radius c that sticks keeps its shape: P = 2 E* integral of (d - x^2/R) dx from 0 to c.
    """
    return 2.0 * modulus * stick_radius * (depth - stick_radius**2 / (3.0 * radius))
