"""Calibration: sessions, fits, records, the registry and its gates."""
