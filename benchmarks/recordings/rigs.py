"""Recordings of rigs and laboratory machines: entries as the catalogue has them."""

from __future__ import annotations

from benchmarks.recordings import rig_readers
from benchmarks.recordings.recording import Recording

_GITHUB = "https://github.com/"
_CITE = "none stated by the publisher: cited, not redistributed"
_DRUM = _GITHUB + "hpvdt/rolling_resistance_rig, commit 8beeba9, analysis/data/aero"

RIGS: tuple[Recording, ...] = (
    Recording(
        name="rack", licence=_CITE, kind="named", names=("coulomb_friction",), runs=rig_readers.rack,
        published_at=_GITHUB + "KonradMnich/friction-identification, commit 8b477df, "
        "input/sample_workspace_3.mat",
        files={"sample_workspace_3.mat": "5d0f1db3317889d594e9f810ba4cf1a890e77149e9e499ea34a3441a466262e5"},
        missing="dry friction with a Stribeck peak: the publisher fits 10 N, a peak of 29.6 N and "
        "67 N s/m (friction_model.m, output/coeffs_for_friction_model.mat); simulated: mass and viscous "
        "friction. The stroke goes one way only",
    ),
    Recording(
        name="heater", kind="named", names=("filter_lag", "channel_delay"), runs=rig_readers.heater,
        published_at=_GITHUB + "jckantor/CBE30338, commit 9341811, notebooks/data/0B.99-Step_Test_Data.csv",
        licence="CC BY-NC-ND 4.0 (the course's text): cited, not redistributed",
        files={
            "0B.99-Step_Test_Data.csv": "a384e1747c09598070ba6451dd0c5febd091ffbad6c662c5842f41924d055633",
        },
        missing="the sensor follows its heater with a lag: the course goes from one state to two, heater "
        "and sensor (recalled and not read again); simulated: one heated mass. The temperatures stand on "
        "steps of 0.32 K, which is the converter and no answer to the lag",
    ),
    Recording(
        name="torsional_wheel", licence="MIT", kind="named", names=("viscous_damping",),
        published_at=_GITHUB + "moorepants/resonance, commit f7f8550, notebooks/03",
        files={
            "bicycle-wheel-radial-inertia-rate-gyro-measurement.csv":
            "83981cc5a86907c4e3a0cd3ee75cdb5aeab32b506150ca757d472db79e5e6933",
        },
        runs=rig_readers.torsional_wheel,
        missing="damping: four peaks in turn are 0.908, 0.906 and 0.906 of the one before, a constant share "
        "as viscous damping makes it (read off the recording); simulated: inertia and stiffness alone, as "
        "in the publisher's notebook",
    ),
    Recording(
        name="tire_on_drum", published_at=_DRUM, licence=_CITE, kind="named",
        names=("constant_force", "coulomb_friction"), runs=rig_readers.tire_on_drum,
        files={
            "Grandprix - Contact - Left - 100 psi.csv":
            "a12e6dd1a240434a06f7eb58980c7a22b1736b43bfb42777252f13f4f4ab578e",
            "Grandprix - Contact - Right - 100 psi.csv":
            "3108338fdc2dd355328cce48fed6b1af0b7ddf72fc43242fef33ddd3b8e5456c",
            "Grandprix - Contact - Left - 120 psi.csv":
            "d6d3c44948a94ef878de39b9f0ee41968182508ce08944173c8b26a45e83c5aa",
            "Grandprix - Contact - Right - 120 psi.csv":
            "9c9aecad7ae317f076d91928aedd8f86e005e8ce7954b46f501a007bda25681b",
        },
        missing="rolling resistance, for which the rig was built (the rig's test procedure: coasting in "
        "contact less coasting in the air); simulated: the drag of the air",
    ),
    Recording(
        name="wheel_in_air", published_at=_DRUM, licence=_CITE, kind="named", names=("quadratic_drag",),
        files={
            "Grandprix - Separate - Left - 110 psi.csv":
            "2168879e196033bc73cda32f914bc037ce3b3b253b34584bfe9ea1660fd0e320",
            "Grandprix - Separate - Left - 120 psi.csv":
            "8db8b51200982af45654ecddf2f5a004f4af9911fffb4ba589c4b76fff521dc5",
            "Grandprix - Separate - Right - 120 psi.csv":
            "c062ec42b8e096fe33809183316d5ac576ab4d722354d560913e86d10dba3f45",
            "Grandprix - Separate - Left - 140 psi.csv":
            "e72fd836a039ffbdd43f0233a32781c0fafa61d2d5e438cdb61914a1cce0df2d",
        },
        runs=rig_readers.wheel_in_air,
        missing="the drag of the air, which the publisher takes for the only loss of the lifted wheel "
        "(the rig's test procedure); simulated: the dry friction of the bearings",
    ),
    Recording(
        name="two_cells", licence="MIT", kind="control", runs=rig_readers.two_cells,
        published_at=_GITHUB + "mvsivaselvan/CIE324-Swing-Project, commit 18a8bc8, "
        "calibration/LoadCellCalibrationData.txt",
        files={
            "LoadCellCalibrationData.txt": "0a9cf85047c9d1f14d82449e22bdbf5ecfb20cfa2e6d0a93a6c1bf2c2c23f6fa",
        },
        missing="nothing: two cells of one make carry one load, and one is a line in the other; the "
        "publisher has one factor for both",
    ),
    Recording(
        name="tire_sweeps", kind="named", names=("relaxation", "thermal_friction"),
        published_at=_GITHUB + "teasit/magic-formula-tyre-library, commit 642592f, "
        "doc/examples/ttc/cornering.mat",
        licence="GPL-3.0 (the repository), published with the permission of the Formula SAE Tire Test "
        "Consortium: cited, not redistributed",
        files={"cornering.mat": "4a0cbc31edd53041a5321b17e1f9124261f700d92092c58eb9af6104d32031bb"},
        runs=rig_readers.tire_sweeps,
        missing="a steady tire has no relaxation length, and its grip does not follow the tread, which warms "
        "from 49 to 75 degC (the recording's own channel); simulated: the Magic Formula over slip angle and "
        "load. A formula of eleven numbers fits a tire to one or two per cent only",
    ),
)  # fmt: skip
