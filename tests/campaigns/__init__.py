"""Campaigns: many virtual tests with seeds, run by hand; a small part of each stands in the tests."""
