"""Plans: the next session, the next test, the next run, the next calibration."""
