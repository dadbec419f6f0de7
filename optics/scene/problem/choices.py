"""Words that the help of the commands names."""

from __future__ import annotations

ENGINES = ("exact", "mitsuba-exact", "mitsuba-mesh")  # of optimizer.engine
# problem files to start from: with every key, and short ones
WHOLE = ("collimated", "far_field", "point", "extended", "two_surfaces")
SHORT = ("mirror", "wall_washer", "plate", "round", "collimator", "sun")
STARTS = (*WHOLE, *SHORT)
# what `answered_problem` knows: sources, and light besides pictures
ASKED_SOURCES = ("beam", "sun", "point", "led")
ASKED_LIGHT = ("square", "disk")
