"""The whole test in one .xlsx file: raw, reduced, fits, characteristics, provenance.

The file is for people and for programs: every number is a number, every text a text, and reading the
file gives back the same result. A hash of the content tells an edited file.
"""

from toolkit.testfile.read import read_test_file
from toolkit.testfile.write import write_test_file

__all__ = ["read_test_file", "write_test_file"]
