"""The recordings: where they are published, their hashes, and what was known before the first diagnosis.

An entry is written before the tool has seen its recording and is not changed by what the tool answers.
"""

from __future__ import annotations

from benchmarks.recordings import readers
from benchmarks.recordings.losses import LOSSES
from benchmarks.recordings.plants import PLANTS
from benchmarks.recordings.recording import Recording
from benchmarks.recordings.rigs import RIGS

_GITHUB = "https://github.com/"
_DATAPLOT = _GITHUB + "usnistgov/dataplot, commit 19a6caa, lib/data"
_NIST = "public domain (NIST-PD)"
_CITE = "none stated by the publisher: cited, not redistributed"
_LPV = _GITHUB + "gsmfnc/LPV_SysId, commit a843d61, noise_simulations/autoencoders"
_COAST = _GITHUB + "Abaiquni/Finding-Rolling-Resistance-for-Electric-Car, commit 83b5854, Data"
_LOAD_CELL = {"LOADCELL.DAT": "263e56bf4f080850e090bf2c3b70b223a48034060ce07865f4122e33232b0ac9"}
_ULTRASONIC = {"CHWIRUT1.DAT": "ecc4ee3cbbbf1500fae64765bf257027ffb4ecc7889c5a7ac974e51af646841b"}
_HANDBOOK = "NIST/SEMATECH e-Handbook"

RECORDINGS: tuple[Recording, ...] = (
    Recording(
        name="load_cell", published_at=_DATAPLOT, licence=_NIST, files=_LOAD_CELL, kind="named",
        names=("nonlinearity",), runs=readers.load_cell,
        missing=f"a load cell's response is quadratic in the load ({_HANDBOOK} 2.3.6.5); "
        "simulated: a straight line",
    ),
    Recording(
        name="load_cell_quadratic", published_at=_DATAPLOT, licence=_NIST, files=_LOAD_CELL, kind="control",
        runs=readers.load_cell, missing=f"nothing: the quadratic of the {_HANDBOOK} 2.3.6.5 is simulated",
    ),
    Recording(
        name="transmittance", published_at=_DATAPLOT, licence=_NIST, kind="named", names=("zero_drift",),
        files={"MAVRO.DAT": "9728e314cfe20b0951fa2e5ee8d72cb595c21747189bfeb9efe346fcd1a78d06"},
        runs=readers.transmittance,
        missing="a filter read ten times a second: readings that wander upwards within the five seconds "
        f"({_HANDBOOK} 1.4.2.6, recalled and not read again); simulated: a constant",
    ),
    Recording(
        name="beam", published_at=_DATAPLOT, licence=_NIST, kind="structure",
        files={"LEW.DAT": "1ee0e741449ac2c79cf56997f2861b553d234899ff3ac4ae195d915c939f90d2"},
        runs=readers.beam,
        missing="a beam's deflection is a sine near 0.3 cycles a reading with a slowly changing amplitude "
        f"({_HANDBOOK} 1.4.2.5, recalled and not read again); simulated: a constant",
    ),
    Recording(
        name="pipeline", published_at=_DATAPLOT, licence=_NIST, kind="control",
        files={"BERGER1.DAT": "a87e31e81c2c91c83e26b75bf8bd5c9a448c4eaf6f4bf3fc20ee899254d6fb30"},
        runs=readers.pipeline,
        missing="nothing: sizes of defects by two ultrasonic measurements follow a line whose scatter grows "
        f"with the size ({_HANDBOOK} 4.6.2, recalled and not read again); simulated: a line",
    ),
    Recording(
        name="ultrasonic", published_at=_DATAPLOT, licence=_NIST, files=_ULTRASONIC, kind="control",
        runs=readers.ultrasonic,
        missing="nothing: exp(-a x)/(b + c x), the model in the head of the file, is simulated",
    ),
    Recording(
        name="ultrasonic_plain", published_at=_DATAPLOT, licence=_NIST, files=_ULTRASONIC, kind="structure",
        runs=readers.ultrasonic,
        missing="the spreading of the beam with the distance (the divisor b + c x in the head of "
        "the file); simulated: exp(-a x) alone",
    ),
    Recording(
        name="carbon_dioxide", published_at=_DATAPLOT, licence=_NIST, kind="structure",
        files={"MLCO2MON.DAT": "3ac1495e5d448366d0c66fd197e84708864ecb5549a4beac412c609cf2b2aa5a"},
        runs=readers.carbon_dioxide,
        missing="the yearly wave of Mauna Loa (3 ppm); simulated: a constant and a trend",
    ),
    Recording(
        name="drive_steps",
        published_at=_GITHUB + "malik-robert/HSM150-data, commit 35c3b1b, Data/Identification",
        licence=_CITE, kind="named", names=("coulomb_friction", "constant_force"),
        files={
            "idf_pos_0.06_1.mat": "c9474de666dd99c65dbda3e00be5ef0b517b4a72c675822efc3281f828da3dd6",
            "idf_pos_0.065_1.mat": "98a9ccbd8da916b60de1f09aa4bd607acfaa7296b44cf759590cf272da675514",
            "idf_neg_0.04_1.mat": "2fae3c385bef58e1fd8b8e7959e4bc8e921decb1e2937713b5066ec52128f1e4",
            "idf_neg_0.045_1.mat": "b28721edbb1a496865efc270b93eaeeb09a86749ce99a6b4518aa6f468d817cd",
        },
        runs=readers.drive_steps,
        missing="dry friction: steady speeds of 138, 214 and 299 rad/s at 0.05, 0.06 and 0.065 N m lie on no "
        "line through the origin (read off the recording; the publisher names the catalogue's inertia and "
        "viscous friction only); simulated: these two. A constant force alone would be half the answer: the "
        "torque has both signs",
    ),
    Recording(
        name="pendulum",
        published_at=_GITHUB + "dfki-ric-underactuated-lab/torque_limited_simple_pendulum, commit ed17ea2, "
        "results/control_method_*/data_measured.csv (pd/system_identification, ilqr, ddp, "
        "direct_collocation)",
        licence="BSD-3-Clause", kind="named", names=("coulomb_friction",),
        files={
            "pendulum_pd.csv": "3a5728e9c5530dd9066c0d7fda4c6a9bf50d86f94538629ace6d2508a7053469",
            "pendulum_ilqr.csv": "f678b8650c167b04476be244f1b2d807d3e0949c5d7b7fa58522164bdcad0afe",
            "pendulum_ddp.csv": "14748fd189abae7b6392a016f2f0494b54bb2a8c014bc435a84b58dbecb2da35",
            "pendulum_direct.csv": "c3f990980169815b93ab37078780e13803327dcb6fc9e019f2d261b988cdaf8f",
        },
        runs=readers.pendulum,
        missing="dry friction of 0.184 N m and an offset of -0.076 N m (the publisher's "
        "system_identification.txt); simulated: inertia, gravity and viscous friction",
    ),
    Recording(
        name="damper", published_at=_LPV + "/Magneto.mat", licence=_CITE, kind="named",
        names=("coulomb_friction", "hysteresis", "saturation"),
        files={"Magneto.mat": "a9e82d26466be6fe55397ab4d6945f8479d9e3fb63b6d92839c0d841149a1e07"},
        runs=readers.damper,
        missing="a magneto-rheological damper yields at a force and runs through a loop over the velocity "
        "(Spencer et al., J. Eng. Mech. 123, 1997, recalled and not read again); simulated: a dashpot",
    ),
    Recording(
        name="robot_arm", published_at=_LPV + "/RobotArm.mat", licence=_CITE, kind="named",
        names=("coulomb_friction",),
        files={"RobotArm.mat": "e1b3699b2ecf8dec54b33badb3a63160a6ce7c8cbf84e1616575b7901d688421"},
        runs=readers.robot_arm,
        missing="dry friction of the motor, and two flexible links behind it (Wernholt and Gunnarsson, "
        "IFAC SYSID 2006, of the same arm, recalled and not read again); simulated: one inertia with "
        "viscous friction",
    ),
    Recording(
        name="coasting_car", published_at=_COAST, licence=_CITE, kind="named",
        names=("constant_force", "coulomb_friction"),
        files={
            "Michelin60A.csv": "99322061badeb56d6d454cad7eaef9c3300b1f5eca1df55e761a421eb40b0db8",
            "Michelin60A1.csv": "119ef4364b937d8c5d6ee5683a917118562735a36f4605c7e903891bd380526e",
            "Michelin60B.csv": "17fe279d9e6e29c5f1944ae586d2cfb4c7d882e96a67abff2255de199e82c425",
            "Michelin60B1.csv": "6f27443892b93a6a4f62bacd7916bba1e1382ea4e0f837be16ab0a6db3d6d5ca",
        },
        runs=readers.coasting,
        missing="the rolling resistance (the publisher's equation has it beside the drag); "
        "simulated: drag alone",
    ),
    Recording(
        name="coasting_car_resisted", published_at=_COAST, licence=_CITE, kind="control",
        files={
            "Michelin60A.csv": "99322061badeb56d6d454cad7eaef9c3300b1f5eca1df55e761a421eb40b0db8",
            "Michelin60A1.csv": "119ef4364b937d8c5d6ee5683a917118562735a36f4605c7e903891bd380526e",
        },
        runs=readers.coasting,
        missing="nothing: the publisher's equation, drag and rolling resistance, on the two runs of one "
        "direction",
    ),
    Recording(
        name="cooling_water",
        published_at=_GITHUB + "ProjectMOSAIC/mosaicData, commit 5020909, data/CoolingWater.rda",
        licence="GPL-2 or later (the package): not redistributed", kind="structure",
        files={"CoolingWater.rda": "7562eb876f95cc5a58912f40b32f8a5fbef0e45868e0eded7a0ecc4dd7c5aaa1"},
        runs=readers.cooling,
        missing="Newton's law is only an approximation of the mug (the publisher's own words on the data's "
        "purpose): hot water loses more than in proportion; simulated: Newton's law",
    ),
    Recording(
        name="wall", published_at=_GITHUB + "AllenDowney/ModSimPy, commit fd52a3c, data/DataOWall.csv",
        licence="MIT", kind="structure",
        files={"DataOWall.csv": "c7d0b6002a689f579ff04686177c6f00c5415b1fff55303266e35e3e9921e89a"},
        runs=readers.wall,
        missing="the wall stores heat: two thermal masses are fitted to these data (Gori et al., Energy and "
        "Buildings 135, 2017, recalled and not read again); simulated: the steady flow through a resistance",
    ),
    *RIGS,
    *LOSSES,
    *PLANTS,
)  # fmt: skip
