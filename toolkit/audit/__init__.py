"""Audit: which calibration computed the acquisition program's own Fy and Mz, and what that changes."""
