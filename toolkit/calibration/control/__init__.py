"""A calibration over the years: as found and as left, control charts, recall interval and due date."""
