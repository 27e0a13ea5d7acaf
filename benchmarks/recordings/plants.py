"""Recordings of materials, tanks, cells, carts and vehicles: entries as the catalogue has them."""

from __future__ import annotations

from benchmarks.recordings import plant_readers
from benchmarks.recordings.recording import Recording

_GITHUB = "https://github.com/"
_CITE = "none stated by the publisher: cited, not redistributed"
_TANK = _GITHUB + "SimonEnsemble/tank_inverse_problem, commit d6aca89, data"
_CALIBRATION = {
    "level_sensor_calibration.csv": "8a5750aebd540f28f3dfaf202ce4a5cedab310ae349d081e99c19558f80a238f",
}

PLANTS: tuple[Recording, ...] = (
    Recording(
        name="electrical_steel", kind="named", names=("hysteresis",), runs=plant_readers.electrical_steel,
        published_at=_GITHUB + "romanszewczyk/JAmodel, commit 4bbe905, 3_mixed/Characterisitcs_mixed_mat",
        licence="MIT",
        files={
            "H_M130_27s.mat": "57bec8a75306e06a5e3fb3a51ba56f0c0f5d2c0fe74a7f78401176c0ec5d3e5b",
            "B_M130_27s.mat": "6d26c631fcd8eaeec601c3ad96c4ac29a526c6ee04a876aadd4e9c660c617af0",
        },
        missing="the magnetic hysteresis, for which the publisher measured these three loops and fits the "
        "law of Jiles and Atherton; simulated: Langevin's curve, which has no memory",
    ),
    Recording(
        name="elastic_tape", kind="named", names=("hysteresis", "creep"), runs=plant_readers.elastic_tape,
        published_at=_GITHUB + "Chongran-Zhao/VHB4910_data, commit a23efd8, "
        "uniaxial-loading-unloading/original_data",
        licence=_CITE,
        files={
            "0d01_2d0.csv": "3839c9f0a89a129e8772d3a54d4fe819e50b142dfcc972a5f4335a0d81833c5b",
            "0d03_2d0_1.csv": "575677920a19f12981151c331e694bd5f9b65609fab30a9a5241d3e888384efe",
            "0d03_2d0_2.csv": "e9f1169b002975e02ef5c6f2cb1e5dee96a249bd10f782250a8678e7b0af522f",
            "0d05_2d0.csv": "fffa39a8cde0e42ee451067f11c60733e98615bb4b785aa15313f1e83c6f8cfb",
        },
        missing="the tape is viscoelastic (the publisher's README, beside tests of relaxation): a loop "
        "between drawing out and letting back, larger forces at larger rates; simulated: Mooney and Rivlin's "
        "rubber",
    ),
    Recording(
        name="cell_pulses", kind="structure", runs=plant_readers.cell_pulses, licence="MIT",
        published_at=_GITHUB + "batterysim/equiv-circ-model, commit 34752e7, "
        "examples/data/cell-low-current-hppc-25c-2.csv",
        files={
            "cell-low-current-hppc-25c-2.csv":
            "8b4135978f150d465dbd5b83f55f7235b8fbd0c39a91fa9033a65c11622f6bf1",
        },
        missing="the overvoltage that follows the current with two time constants, which the publisher's "
        "circuit has as two pairs of resistance and capacity; simulated: the voltage at rest and a "
        "resistance. A lag of the current, not of the channel: no effect of the catalogue is that",
    ),
    Recording(
        name="draining_tank", kind="control", published_at=_TANK, licence=_CITE,
        files=_CALIBRATION | {
            "liq_level_data_empty_train.csv":
            "28f53563ef456c7a49235a88ddda6001b0f83b796cf66d3b72fe2eb19e10d8a2",
            "liq_level_data_empty_test.csv":
            "455f01ae2f688737d5368925ec5ecda5dbb2637fe07b8631e4f34f19ea6d7822",
        },
        runs=plant_readers.draining_tank,
        missing="nothing: the publisher's own equation, Torricelli's law in a tapered tank, on his two runs "
        "of the empty tank",
    ),
    Recording(
        name="tank_with_bottle", kind="structure", published_at=_TANK, licence=_CITE,
        files=_CALIBRATION | {
            "liq_level_data_w_bottle.csv":
            "5261e650e80de126bc1ea2bd0e2c56330ac786fec52d4e0e996969305ebebec2",
        },
        runs=plant_readers.tank_with_bottle,
        missing="a bottle stands in the tank and takes 48 cm^2 of its area below 14 cm, fewer and fewer "
        "above (the publisher's bottle_area.csv); simulated: the empty tank",
    ),
    Recording(
        name="propeller", kind="control", licence="MIT", runs=plant_readers.propeller,
        published_at=_GITHUB + "alspitz/esc_test, commit 4078609, data/rcbench",
        files={
            "Log_2019-11-07_174807.csv": "89f5b314f9bc3860f553e49a0f5e26f42e9cb314bc538fda98498d3277407b91",
            "Log_2019-11-07_175456.csv": "0557e8125d2f6454b1f945f2ecd31042300b5c5c319969c0b4b0cefa57c39b7d",
            "Log_2019-11-07_184325.csv": "f5bebeb85719f2be4d29bd3cf397f30265891048793e044751cbc29f1ca6080b",
            "Log_2019-11-07_211050.csv": "441687ee74b1aa74ebb2f166292657e664335f557b796d80adc64cff3cde5660",
        },
        missing="nothing: the publisher's two models, a thrust quadratic in the speed and a torque in "
        "proportion to the thrust below 5 N, which he expects to be the propeller's alone; settled rows of "
        "one motor on three controllers",
    ),
    Recording(
        name="belt_cart", kind="named", names=("coulomb_friction",), licence=_CITE,
        published_at=_GITHUB + "nielsSkov/masterThesisMatlab, commit 0e2c725, "
        "parameterEstimation/data/cartTest1",
        runs=plant_readers.belt_cart,
        files={
            "testOffPointThree.csv": "44b4fdf0e494a2ca372dc5b0b86f2daa00bea08b5979c43d7a5f710077e3e021",
            "testOffPointFour.csv": "1d75df82b4387f978028759f355e0c9644170c5549a1c69b921e73038805ada4",
            "testOffPointFive.csv": "536be3a28625760628fbd7721adedd2b433f4290044b3ffdec1c34722cfcc370",
            "testOffPointSix.csv": "8d3a86209bcbdf1e065388ca4b5fcfea43d1b6c245137c9803d495582c34da41",
        },
        missing="dry friction, which the publisher's simulation has alone (sim_cartPendulum.m), of a size "
        "for each direction and place; simulated: viscous friction. The two directions differ as by a "
        "constant force, which alone would be half the answer",
    ),
    Recording(
        name="small_car", kind="named", names=("channel_delay", "filter_lag"), licence="MIT",
        published_at=_GITHUB + "Lorenzo-Lyons/DART, commit 4b52523, "
        "System_identification/Data/40_sinusoidal_steering_data",
        runs=plant_readers.small_car,
        files={
            "car_1_Datarecording_01_22_2024_11_40_46.csv":
            "6ecf3eeac51f1bc4011a3d927fe2d558cf9e6256675564f5a7ebc20218617329",
            "car_1_Datarecording_01_22_2024_11_41_28.csv":
            "46e4aeb8d9883b041ad223b1bbbeed3c7ad697e22d1f82caae6f14af42f53be4",
            "car_1_Datarecording_01_22_2024_11_42_22.csv":
            "9ca253751c91f9cf0155c453e4e2a3761e7213899562657ea929125560f4efff",
            "car_1_Datarecording_01_22_2024_11_44_35.csv":
            "2824b5884bbf49ecc9af3a095671f20f667730a6244e46944af8cc132cc40f74",
        },
        missing="the steering is late: the publisher finds its delay from these runs "
        "(4_0_steering_delay_on_board_sensors.py) and a lag of the first order later; simulated: the "
        "kinematic single-track model, whose wheels turn at once",
    ),
)  # fmt: skip
