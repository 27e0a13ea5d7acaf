"""Tests against each other, against a maker's table: differences, their significance, precision."""
