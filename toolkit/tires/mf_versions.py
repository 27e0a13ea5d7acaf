"""Which names of a tire file belong to which Magic Formula.

FITTYP says which one a file is of. Files that went through several programs carry names of the other one
too: zeros that fill a list, or numbers left from another fit. Such a name is not evaluated, in pure as in
combined slip, whatever equation the two formulas share; where its number would change a force, it is named.

MF 5.2: MF-Tyre 5.2 and PAC2002, Pacejka (2002). MF 6.x: Pacejka (2012), 4.E1 to 4.E78;
Besselink et al. (2010).
"""

from __future__ import annotations

from collections.abc import Mapping

_ONLY_6X = frozenset(
    "PPX1 PPX2 PPX3 PPX4 RBX3 PEY5 PKY4 PKY5 PKY6 PKY7 PPY1 PPY2 PPY3 PPY4 PPY5 RBY4 QDZ10 QDZ11 PPZ1 PPZ2 "
    "LKYC LKZC LMUV".split()
)
_ONLY_52 = frozenset(["PHY3", "LGAX", "LGAY", "LGAZ"])
FOREIGN: Mapping[str, frozenset[str]] = {"5.2": _ONLY_6X, "6.x": _ONLY_52}
"""By the version of a file: names of forces and moments that only the other version has."""

# What a number is where a name changes nothing: a scale factor 1, a coefficient 0.
_NEUTRAL = {"PKY4": 2.0, "LMUV": 0.0}


def ignored(version: str, coefficients: Mapping[str, float]) -> tuple[str, ...]:
    """Return the names that a file's Magic Formula has not, and whose numbers would change a force.

    >>> ignored("5.2", {"PCY1": 1.3, "RBX3": -2.0, "RBY4": 0.0, "PKY4": 2.0})
    ('RBX3',)
    """
    return tuple(
        name
        for name, value in coefficients.items()
        if name in FOREIGN[version] and value != _NEUTRAL.get(name, 1.0 if name.startswith("L") else 0.0)
    )
