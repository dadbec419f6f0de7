"""What everything stands on: errors, checks, Dr.Jit's backends, workers, optimisers."""
