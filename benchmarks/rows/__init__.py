"""Rows of benchmarks: printed, stored, quoted in pages."""
