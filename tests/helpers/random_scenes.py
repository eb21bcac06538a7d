"""Random scenes over all parts, with values over decades around a contact that is drawn first."""

import math

import numpy as np

from sim.solid import HalfSpace
from sim.spectrum.families import Gaussian


def random_scene(seed):
    """Return the tables of a scene: any drive with any bonds, shear and contact; loads that cross pull-off."""
    draw = Draw(seed)
    modulus, radius, work = (
        draw.log(1e5, 3e6),
        draw.log(1e-4, 5e-3),
        draw.log(5e-3, 0.2),
    )
    # contact radius at no load
    size = (9.0 * math.pi * work * radius**2 / (8.0 * modulus)) ** (1.0 / 3.0)
    duration = draw.log(1e-2, 3.0)
    scale = Scale(
        modulus,
        radius,
        work,
        size,
        1.5 * math.pi * work * radius,
        duration,
        draw.log(0.1, 100.0) * size,
    )
    bonds, drive = draw.bonds(scale), draw.drive(scale)
    if "contact_stiffness" in drive and "rupture" not in bonds:
        drive |= {"contact_stiffness": "rigid", "damping": draw.log(1e-5, 1.0)}
    return {
        "seed": seed,
        "clock": {
            "duration": duration,
            "step": duration / int(draw.choice((12, 48, 192))),
        },
        "solid": {"shear_modulus": modulus},
        "sphere": {"radius": radius},
        "adhesion": {
            "work": work,
            "bond_share": float(draw.choice((0.0, 0.5, 1.0, 1.0))),
        },
        "contact": draw.contact(scale),
        "drive": drive,
        "bonds": bonds,
        "shear": draw.shear(scale),
        "ensemble": {"members": 3},
    }


def random_layer(seed):
    """Return a random scene on a layer, from a fourteenth of a contact radius thick to fourteen contact radii."""
    scene, draw = random_scene(seed), np.random.default_rng([seed, 48])
    modulus, radius = scene["solid"]["shear_modulus"], scene["sphere"]["radius"]
    size = np.cbrt(
        9.0 * math.pi * scene["adhesion"]["work"] * radius**2 / (8 * modulus)
    )
    scene["solid"]["thickness"] = float(size * 14.0 ** draw.uniform(-1.0, 1.0))
    scene["shear"].pop("contact", None)
    return scene


class Scale:
    """Modulus [Pa], sphere radius [m], work of adhesion [J/m²], contact radius [m], pull-off force [N], duration [s].

    ``path`` is the distance that a prescribed drive slides [m], ``stress`` that of a strong interface [Pa].
    """

    def __init__(self, modulus, radius, work, size, force, duration, path):
        self.modulus, self.radius, self.work, self.size, self.force = (
            modulus,
            radius,
            work,
            size,
            force,
        )
        self.duration, self.path = duration, path
        self.stress = math.sqrt(modulus * work / size)

    @property
    def stiffness(self):
        """Tangential stiffness of the contact [N/m], that of a disc on an incompressible half-space."""
        return 8.0 * self.modulus * self.size


class Draw:
    """Draws of one seed."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)

    def log(self, low, high):
        return float(math.exp(self.random.uniform(math.log(low), math.log(high))))

    def choice(self, values):
        return values[self.random.integers(len(values))]

    def chance(self, probability):
        return self.random.random() < probability

    def course(self, value, signed=True):
        """Return a value, a course between two of them, or a table with a jump."""
        other = value * self.random.uniform(-1.0 if signed else 0.1, 2.0)
        return self.choice(
            (
                value,
                value,
                {"from": other, "to": value},
                {"from": value, "to": other, "cycles": 1},
            )
        )

    def contact(self, scale):
        load = self.course(scale.force * self.random.uniform(-1.1, 3.0))
        depth = self.course(
            scale.size**2 / scale.radius * self.random.uniform(-0.5, 1.0)
        )
        controls = (
            {"load": load},
            {"indentation": depth},
            {"displacement": depth, "stiffness": scale.stiffness},
        )
        table = {
            "after_pull_off": self.choice(("stay_open", "reattach", "stop"))
        } | self.choice(controls)
        if self.chance(0.2):
            table["reversible"] = self.log(1e-3, 0.1)
        if self.chance(0.2):
            table |= {
                "model": "rate_dependent",
                "front_speed": scale.size / scale.duration * self.log(0.1, 1e3),
            }
        return table

    def drive(self, scale):
        speed = scale.path / scale.duration
        body = {"mass": self.log(1e-7, 1e-3)} if self.chance(0.3) else {}
        body |= {"damping": self.log(1e-5, 1.0)} if self.chance(0.4) else {}
        body |= {"viscosity": self.log(1.0, 1e5)} if self.chance(0.3) else {}
        body |= {
            "contact_stiffness": self.choice(("half_space", "rigid", scale.stiffness))
        }
        pull = scale.stress * math.pi * scale.size**2 * self.log(0.01, 1.0)
        return self.choice(
            (
                {"model": "steady", "speed": speed},
                {"model": "start", "rest": 0.3 * scale.duration, "speed": speed},
                {
                    "model": "ramp",
                    "from": 0.01 * speed,
                    "to": 2.0 * speed,
                    "scale": self.choice(("linear", "log")),
                },
                {
                    "model": "spring",
                    "stage": self.course(speed),
                    "stiffness": scale.stiffness * self.log(1e-3, 1.0),
                }
                | body,
                {
                    "model": "spring",
                    "stage": speed,
                    "stiffness": scale.stiffness * self.log(1e-3, 1.0),
                }
                | body,
                {"model": "force", "force": self.course(pull, signed=False)} | body,
            )
        )

    def bonds(self, scale):
        """Return bonds that live for a hundredth to ten of the run, and bear up to the strength of the interface."""
        rate, stress = (
            self.log(0.1, 100.0) / scale.duration,
            scale.stress * self.log(0.01, 1.0),
        )
        # distance that renews bonds
        binding, life = rate * self.log(0.1, 30.0), scale.path * self.log(1e-3, 1.0)
        rest = {"start": self.choice(("steady", "bonded", "empty"))}
        law = {
            "stress": stress,
            "critical_speed": life * binding,
            "rebinding_rate": binding,
        } | rest
        force = self.log(1e-12, 2e-11)
        density = 10.0 ** self.random.uniform(15.0, 17.0)
        ruptures = (
            {"model": "constant", "rate": rate},
            {"model": "bell", "zero_force_rate": rate, "bell_force": force},
            {"model": "cut_off", "stretch": life, "rate": rate},
            {
                "model": "catch",
                "catch_rate": rate,
                "catch_force": force,
                "slip_rate": 0.1 * rate,
                "slip_force": force,
            },
        )
        rupture = self.choice(ruptures)
        stretched = {
            "rupture": rupture,
            "rebinding_rate": binding,
            "bond_stiffness": stress / (density * life),
        } | rest
        stretched |= {"site_density": density}
        carried = {"area": self.choice(("present", "present", "carried"))}
        models = [
            {"model": "none", "stress": stress},
            {"model": "steady", "stress": stress, "critical_speed": life * binding},
            {"model": "rate"} | law | carried,
            {"model": "counted", "sites": int(self.log(3.0, 1e5))} | law,
            {"model": "cohort", "tolerance": 1e-3} | stretched | carried,
        ]
        if rupture["model"] != "catch":
            models.append({"model": "rate"} | stretched | carried)
            models.append(
                {"model": "tracked", "sites": int(self.log(1.0, 100.0))} | stretched
            )
        return self.choice(models)

    def shear(self, scale):
        """Return fluctuations that take from a hundredth to twice the work of adhesion."""
        length = scale.size * self.log(0.01, 0.3)
        unit = HalfSpace(shear_modulus=scale.modulus).stored_energy(
            Gaussian(rms=1.0, length=length)
        )
        rms = math.sqrt(scale.work * self.log(0.01, 2.0) / unit)
        amplitude = self.choice(
            (
                {"model": "constant"},
                {
                    "model": "onset",
                    "speed": scale.path / scale.duration,
                    "width": 0.5,
                    "floor": 0.1,
                },
                {"model": "stress", "reference": 0.3 * scale.stress},
                {"model": "slip_rate", "floor": 0.1, "memory_length": length},
            )
        )
        mean = {
            "spectrum": {"model": "gaussian", "rms": rms, "length": length},
            "amplitude": amplitude,
        }
        mean |= {
            "contact": self.choice(("plane", "plane", "disc")),
            "paid_by_adhesion": self.choice((0.0, 1.0, 1.0)),
        }
        correlation = self.choice(
            (
                {"model": "slip", "length": length},
                {"model": "time", "time": scale.duration * self.log(0.01, 1.0)},
                {"model": "wave", "waves": 1.0},
                {"model": "diffusion", "diffusivity": length**2 / scale.duration},
            )
        )
        field = mean | {"correlation": correlation, "points": 16}
        field |= {
            "cell": 8.0 * length
            if mean["contact"] == "plane"
            else max(8.0 * length, 4.0 * scale.size)
        }
        if amplitude["model"] != "constant":
            relaxing = {"amplitude": amplitude | {"relaxing": True}}
            field |= self.choice((relaxing, {}))
        models = (
            {"model": "uniform"},
            {"model": "mean"} | mean,
            {"model": "banded", "tolerance": 0.05} | field,
            {"model": "modal"} | field,
            {"model": "mapped"} | field,
        )
        return self.choice(models)
