"""The version of the toolkit: written into every record, reduced test and document."""

__version__ = "0.1.0"
