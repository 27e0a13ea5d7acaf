"""Which calibration computed a file."""
