"""Tire models, one a file, and their fits."""
