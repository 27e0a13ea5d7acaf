"""Raw blocks to one mean a condition: tare, calibration, averaging, axes, common load."""
