"""The case: what a simulation and its recordings are, read from CASE.toml and the files that it names."""
