"""Illumination optics on exact spline surfaces: tracing, design, verification, reports."""
