"""Words to choose from that the help of the commands names; they are all that it loads of this room."""

from __future__ import annotations

ENGINES = ("exact", "mitsuba-exact", "mitsuba-mesh", "mitsuba-ptracer")  # of optimizer.engine
STARTS = ("collimated", "far_field", "point", "extended", "two_surfaces")  # problem files to start from
