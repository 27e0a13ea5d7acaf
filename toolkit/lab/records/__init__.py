"""Calibration records: sessions, gates, budgets, control, decisions, certificates."""
