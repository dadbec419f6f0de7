"""The illuminants of the CIE that the program knows; their tables load numpy."""

from __future__ import annotations

ILLUMINANTS = ("A", "D65", "LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5")
