"""A diagnosis for people: one self-contained page, its figures first."""
