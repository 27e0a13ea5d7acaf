"""The version of the toolkit, written into every record, reduced test and document, and its distribution."""

__version__ = "1.0.0"
DISTRIBUTION = "tire-lab-toolkit"
"""What ``pip install`` takes: an index has another's package under the name `toolkit`."""
