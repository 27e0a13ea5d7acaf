"""Sheets of plans."""
