"""Forgeries by a principle: each part of each signed thing, by each kind of change."""
