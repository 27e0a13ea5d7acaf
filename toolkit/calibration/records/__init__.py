"""The immutable record of a calibration, its issued digits and its golden vectors."""
