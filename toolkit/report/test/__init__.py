"""A test's report: its content, tables and figures."""
