"""Archives: an audit of old tests, its answer, and the reports that it amends."""
