"""Tires as FMU."""
