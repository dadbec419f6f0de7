"""Words that the help of the commands names."""

from __future__ import annotations

ENGINES = ("exact", "mitsuba-exact", "mitsuba-mesh")  # of optimizer.engine
STARTS = ("collimated", "far_field", "point", "extended", "two_surfaces")  # problem files to start from
# what `answered_problem` knows: sources, and light besides pictures
ASKED_SOURCES = ("beam", "point", "led")
ASKED_LIGHT = ("square", "disk")
