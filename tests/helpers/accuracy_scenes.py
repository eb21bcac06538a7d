"""Sixty small scenes over all parts, with which an accepted error is held against the true one.

Twelve are named, and held to 0.3 % as well. The others take one model of each part in turn. The numbers of models have
no common divisor, so that each pair of models occurs if there are as many scenes as pairs.
"""

BASE = {
    "solid": {"shear_modulus": "1.6 MPa"},
    "sphere": {"radius": "2 mm"},
    "adhesion": {"work": "42 mJ/m^2"},
    "contact": {"load": "4 mN"},
    "clock": {"duration": "80 ms", "step": "1 ms", "record": "4 ms"},
    "ensemble": {"members": 32},
}
RAMP = {"model": "ramp", "from": "0.3 mm/s", "to": "20 mm/s", "scale": "log"}
STEADY = {"model": "steady", "speed": "3 mm/s"}
TABLE = {
    "model": "table",
    "time": ["0 s", "40 ms", "40 ms", "80 ms"],
    "speed": ["1 mm/s", "1 mm/s", "8 mm/s", "8 mm/s"],
}
RATE = {
    "model": "rate",
    "critical_speed": "10 mm/s",
    "rebinding_rate": "500 1/s",
    "stress": "0.3 MPa",
}
COUNTED = RATE | {"model": "counted", "sites": 4000}
BELL = {
    "model": "rate",
    "rupture": {"model": "bell", "zero_force_rate": "25 1/s", "bell_force": "4 pN"},
    "bond_stiffness": "0.8 uN/m",
    "rebinding_rate": "250 1/s",
    "site_density": "6.5e16 1/m^2",
}
COHORT = BELL | {"model": "cohort", "tolerance": 1e-3}
BAND = {"model": "band", "rms": "60 kPa", "longest": "88 um", "shortest": "60 um"}
SHEAR = {
    "model": "banded",
    "cell": "0.24 mm",
    "spectrum": BAND,
    "correlation": {"model": "slip", "length": "5 um"},
}
TIME = SHEAR | {"correlation": {"model": "time", "time": "10 ms"}}
ONSET = SHEAR | {
    "amplitude": {"model": "onset", "speed": "2.5 mm/s", "width": 0.3, "floor": 0.1}
}
EDGE = {"model": "rate_dependent", "load": "4 mN", "front_speed": "0.1 mm/s"}
SPRING = {
    "model": "spring",
    "stage": "2 mm/s",
    "stiffness": "200 N/m",
    "damping": "5 N s/m",
    "start": "steady",
}

#: Tables that replace those of the base, by name.
NAMED = {
    "bonds alone": {"drive": RAMP, "bonds": RATE},
    "stretched bonds": {"drive": STEADY, "bonds": BELL},
    "cohorts at a jump": {"drive": TABLE, "bonds": COHORT},
    "counted bonds": {"drive": RAMP, "bonds": COUNTED},
    "a band": {"drive": STEADY, "shear": SHEAR},
    "an onset": {"drive": RAMP, "bonds": RATE, "shear": ONSET},
    "in time": {"drive": TABLE, "bonds": RATE, "shear": TIME},
    "both random": {"drive": RAMP, "bonds": COUNTED, "shear": SHEAR},
    "spring": {"drive": SPRING, "bonds": BELL},
    "spring, field": {"drive": SPRING, "bonds": BELL, "shear": SHEAR},
    "spring, time": {"drive": SPRING, "bonds": BELL, "shear": TIME},
    "soft spring": {"drive": SPRING | {"stiffness": "60 N/m"}, "bonds": BELL},
}
TRACKED = BELL | {"model": "tracked", "sites": 200}
#: Tables of the parts that are taken in turn: 3, 7, 5 and 4 of them at a prescribed speed, 3, 4 and 5 behind springs.
IN_TURN = (
    [{"drive": drive} for drive in (STEADY, RAMP, TABLE)],
    [
        {"bonds": bonds}
        for bonds in (
            RATE,
            BELL,
            COHORT,
            COUNTED,
            TRACKED,
            {"model": "steady", "critical_speed": "10 mm/s", "stress": "0.3 MPa"},
            {"model": "none", "stress": "0.2 MPa"},
        )
    ],
    [
        {},
        {"shear": SHEAR},
        {"shear": TIME},
        {"shear": ONSET},
        {"shear": SHEAR | {"correlation": {"model": "wave", "waves": 1.0}}},
    ],
    [
        {},
        {"contact": EDGE},
        {"contact": {"indentation": "3 um"}},
        {"solid": BASE["solid"] | {"thickness": "0.2 mm"}},
    ],
)
BEHIND_SPRINGS = (
    [
        {"drive": SPRING | keys}
        for keys in (
            {},
            {"stiffness": "60 N/m"},
            {"mass": "1 mg", "damping": "0.5 N s/m"},
        )
    ],
    [
        {"bonds": BELL},
        {"bonds": COHORT},
        {"bonds": BELL | {"rebinding_rate": "500 1/s"}},
        {"bonds": TRACKED},
    ],
    [{}, {"shear": SHEAR}, {"shear": TIME}, {"contact": EDGE}, {"shear": ONSET}],
)


def _in_turn(parts, count, name):
    """Return scenes that take one of each part in turn."""
    return {
        f"{name} {k}": {
            key: table for part in parts for key, table in part[k % len(part)].items()
        }
        for k in range(count)
    }


SCENES = (
    NAMED | _in_turn(IN_TURN, 32, "prescribed") | _in_turn(BEHIND_SPRINGS, 16, "driven")
)
#: Scenes behind springs; there means over the second half of the run are compared.
SPRINGS = [
    name for name, tables in SCENES.items() if tables["drive"]["model"] == "spring"
]


def accuracy_scene(name):
    """Return the tables of a scene."""
    return BASE | {"name": name, "seed": 1 + list(SCENES).index(name)} | SCENES[name]
