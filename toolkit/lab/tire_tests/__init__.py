"""Tire tests: read, reduced, fitted, compared, converted, reported, watched for."""
