"""Upkeep of an installation and of a home: what is lacking, what is of an older version, its migration."""
