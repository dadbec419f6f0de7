"""Lenses as they are made: perturbations, form errors, samples, measurement, machining."""
