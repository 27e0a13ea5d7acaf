"""Magic Formula 6.2 over load, camber, pressure and longitudinal slip.

For FX, FY and MZ its equations are those of 6.1 (`toolkit.tires.models.mf61`); the files differ in FITTYP.
"""

from __future__ import annotations

from toolkit.tires.mf import MF61, magic_formula
from toolkit.tires.models.mf61 import forces

MODEL = magic_formula(
    name="mf62",
    title="Magic Formula 6.2",
    reference="Pacejka (2012), eq. 4.E1 to 4.E78; Besselink, Schmeitz, Pacejka (2010)",
    valid="within the loads, angles, pressures and slips of the data",
    parameters=MF61,
    evaluator=forces,
)
