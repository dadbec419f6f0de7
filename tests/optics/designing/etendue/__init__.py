"""What light a source can make: kernels, certified approximations, analytic cases and baselines."""
