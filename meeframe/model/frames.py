"""Local frames in which the contact of a case is described."""

from meeframe.fields import Array
from meeframe.mesh import ContactZone, FrictionAxes
from meeframe.system.rotated import rotated_frames


def frames_along(zone: ContactZone, axes: FrictionAxes | None) -> Array:
    """Return the frames (n, 3, 3) of a contact zone, rotated to the friction axes if there are any."""
    return zone.frames if axes is None else rotated_frames(zone.frames, axes.directions(zone.points))
