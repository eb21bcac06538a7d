"""Small scenes over all parts, with which an accepted error is held against the true one. The list may grow."""

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
SCENES = {
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
#: Scenes behind springs; there means over the second half of the run are compared.
SPRINGS = [name for name, tables in SCENES.items() if tables["drive"] is SPRING] + [
    "soft spring"
]


def accuracy_scene(name):
    """Return the tables of a scene."""
    return BASE | {"name": name, "seed": 1 + list(SCENES).index(name)} | SCENES[name]
