"""What people call: scripts, sweeps, the command line."""
