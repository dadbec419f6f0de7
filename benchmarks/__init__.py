"""Run time and error, measured: `thbcad bench NAME` runs a module of this folder from a checkout."""
