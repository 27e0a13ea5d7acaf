"""A tire as FMU: its equations recorded, written as C, described, compiled and put into one file."""
