"""Evaluations by published standards: ASTM E74 and ISO 376."""
