"""The local frames in which the contact of a case is described."""

from meeframe.core.fields import Array
from meeframe.core.turned import turned_frames
from meeframe.geometry import ContactZone, FrictionAxes


def frames_along(zone: ContactZone, axes: FrictionAxes | None) -> Array:
    """The frames (n, 3, 3) of a contact zone, turned to the friction axes if there are any."""
    return zone.frames if axes is None else turned_frames(zone.frames, axes.directions(zone.points))
