"""Cornering and aligning stiffness, pull, Gough plots: what a requester reads off a test."""
