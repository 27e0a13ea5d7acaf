"""A calibration for people: the report of a fit, control charts, a budget."""
