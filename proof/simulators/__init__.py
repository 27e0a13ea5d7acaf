"""The simulations that cases hand to the tool as sim.py; each stands alone."""
