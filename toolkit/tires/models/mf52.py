"""Magic Formula 5.2 over load, camber and longitudinal slip; the equations stand in `toolkit.tires.mf52`."""

from __future__ import annotations

from toolkit.tires.global_model import GlobalModel
from toolkit.tires.mf52 import forces
from toolkit.tires.mf_parameters import MF52, mf_forces, mf_starts

MODEL = GlobalModel(
    name="mf52",
    title="Magic Formula 5.2 (PAC2002)",
    reference="Pacejka, Tyre and Vehicle Dynamics (2002), eq. 4.E1 to 4.E78",
    valid="within the loads, angles and slips of the data; one pressure",
    axes="ISO-W",
    channels=("FX", "FY", "MZ"),
    parameters=MF52,
    forces=mf_forces(MF52, forces),
    starts=mf_starts,
)
