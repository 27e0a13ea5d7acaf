"""Measurement uncertainty of a calibration: budget, prediction at any load, Monte Carlo cross-check."""
