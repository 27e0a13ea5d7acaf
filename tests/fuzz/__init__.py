"""The fuzz bench: every input format, mutated by its structure, through the command that reads it."""
