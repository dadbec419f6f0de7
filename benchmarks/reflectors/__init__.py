"""Free mirrors before light and charts of others' own, and how far their light is from what was asked for."""
