"""Do stated intervals cover the truth? Simulated sessions and tests against what they were made from."""
