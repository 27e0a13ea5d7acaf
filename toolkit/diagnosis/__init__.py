"""Simulation against recording: locate the mismatch, name the physics left out, show the fit improve.

One direction inside as well: case > kinds (simulators) > chain (effects on them) > noise, fit > search >
answer. Nothing here draws; `report.diagnosis` makes the page.
"""
