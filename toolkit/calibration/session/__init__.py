"""A calibration session: SESSION.toml and its CSV files, read and checked."""
