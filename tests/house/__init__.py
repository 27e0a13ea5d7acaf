"""The house in figures: ``python -m tests.house``.

Lines and modules by layer, names that say nothing, modules of the command line without a command, effects
named outside their own file, imports against the layers, pages cited that do not exist.
"""
