"""Recordings of what a motion loses to friction, drag and loops: entries as the catalogue has them."""

from __future__ import annotations

from benchmarks.recordings import loss_readers
from benchmarks.recordings.recording import Recording

_GITHUB = "https://github.com/"
_CITE = "none stated by the publisher: cited, not redistributed"

LOSSES: tuple[Recording, ...] = (
    Recording(
        name="band_brake", kind="named", names=("coulomb_friction", "hysteresis", "backlash"),
        published_at=_GITHUB + "ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash, commit 0e09aa9, "
        "data/dataset-1/characterization datasets",
        licence="CC BY-SA 4.0: cited, not redistributed", runs=loss_readers.band_brake,
        files={
            "0.5Hz35lbtension.json": "15372efa141b1cf8ba7e8166bc37f51084f2f2ab76b466df4ee93f999fcbb5c2",
            "1Hz35lbtension.json": "7f9c9e25e8747d89c3fc09be883fb010352b0916d5e50a2d6cb834c2904af394",
        },
        missing="dry friction of a band on a drum, with backlash at each reversal (the publisher's README, "
        "and the loops drawn in it); simulated: a viscous damper",
    ),
    Recording(
        name="swinging_bob", kind="named", names=("quadratic_drag",), runs=loss_readers.swinging_bob,
        published_at=_GITHUB + "DavidW99/Damping_Oscillator, commit 5b8248c, damping_angle.xlsx",
        licence=_CITE,
        files={"damping_angle.xlsx": "ff22222f07239f2e8a4d77c9f15a44f6d85fc19919de0ca242e430f0a29261cc"},
        missing="the drag of the air: the publisher's terms are 0.25 d^2 v^2 and 1.6e-4 d v (SI), of which "
        "the first is a hundred times the second at the lowest point; simulated: gravity alone",
    ),
    Recording(
        name="air_cylinder", kind="named", names=("coulomb_friction", "hysteresis"),
        published_at=_GITHUB + "EvaZillen/3D-printed-pneumatic-actuator, commit 6e0bcb4, "
        "results_pneumatic-actuator/data/friction",
        licence="CC0 1.0", runs=loss_readers.air_cylinder,
        files={
            "Circle_3bar.csv": "d78d5575b6d9dcf57453107bea96b6dd8d59944a9f2df57f448621025115dade",
            "Circle_5bar.csv": "163b266a3ae723b4d3d8be90ad50f3caca390fa5e76ff13a7c5287a1c8502755",
        },
        missing="the sliding friction of the piston's seal, for which the publisher made these runs (README "
        "of the results); simulated: pressure times the area of a bore of 25 mm",
    ),
    Recording(
        name="concrete_column", kind="named", names=("hysteresis", "saturation"),
        published_at=_GITHUB + "sebin-oh/Bouc-Wen-class-model, commit 22520ed, Example/experimental data.mat",
        licence="GPL-3.0 (the repository): cited, not redistributed", runs=loss_readers.concrete_column,
        files={
            "column_experimental_data.mat":
            "9e755ade1316b905cdf3f9726b027b929ef081a2da632217f92c36e197aadac6",
        },
        missing="the loop of a column of reinforced concrete that yields (Gill, Park and Priestley 1979, "
        "fitted by the publisher with a Bouc-Wen law that also softens and pinches); simulated: a spring",
    ),
)  # fmt: skip
