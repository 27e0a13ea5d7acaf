"""Simulators: from a case to predictions with effects, one module for each kind of simulation."""
