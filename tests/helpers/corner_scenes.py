"""Random scenes at corners of the theory: contacts that open behind springs, bodies that ring, steps of many events.

``random_scenes`` draws ordinary scenes over all parts. Here a corner is drawn first, and then the numbers that reach
it, so that some hundred scenes meet each corner often. ``slider_rules.reached`` counts the corners that runs reached.
"""

import math

from helpers.random_scenes import Draw, Scale

#: Corners, each as often as it is drawn among so many scenes.
CORNERS = {"opening": 20, "ringing": 12, "decades": 7, "events": 1}
#: Events of tracked bonds at rest in each clock step of a scene of many events.
MANY_EVENTS = 1.1e6, 2.6e6


def corner_scene(seed):
    """Return the tables of a driven scene at one of the corners."""
    draw = CornerDraw([2, seed])
    corner = draw.choice(
        [name for name, often in CORNERS.items() for _ in range(often)]
    )
    return {"seed": seed} | getattr(draw, corner)()


class CornerDraw(Draw):
    """Draws of one seed; each corner is a method that returns the tables of a scene."""

    def opening(self):
        """Return a scene whose contact opens, and in most closes again, while a spring or a force pulls the slider."""
        scale = self.scale(self.log(1e-2, 3.0))
        bonds = self.interface(scale, self.log(0.1, 100.0) / scale.duration)
        drive = self.pull(
            scale, bonds, self.choice(("spring", "spring", "spring", "spring", "force"))
        )
        contact = self.opening_contact(scale)
        if self.chance(0.15):
            contact |= {
                "model": "rate_dependent",
                "front_speed": scale.size / scale.duration * self.log(1.0, 1e3),
            }
        if self.chance(0.1):
            contact["reversible"] = self.log(1e-3, 0.1)
        shear = self.shear(scale) if self.chance(0.15) else {"model": "uniform"}
        return self.tables(scale, self.choice((12, 48, 192)), bonds, drive, contact) | {
            "shear": shear
        }

    def ringing(self):
        """Return a scene of a body that rings on its bonds, with no damping or little of it."""
        scale = self.scale(self.log(1e-3, 3.0))
        model = self.choice(("cohort", "cohort", "cohort", "cohort", "rate", "tracked"))
        bonds = self.interface(
            scale, self.log(1e-4, 1.0) / scale.duration, model, stretched=True
        )
        period = scale.duration * (
            self.log(0.005, 0.1) if model != "tracked" else self.log(0.05, 0.2)
        )
        bonds.table["start"] = self.choice(("steady", "bonded"))
        drive = self.pull(
            scale, bonds, self.choice(("force", "force", "force", "spring")), body=False
        )
        drive["mass"] = bonds.stiffness * (period / (2.0 * math.pi)) ** 2
        if self.chance(0.3):
            drive["damping"] = (
                2.0 * self.log(1e-5, 0.03) * math.sqrt(drive["mass"] * bonds.stiffness)
            )
        contact = {"load": scale.force * self.random.uniform(0.0, 3.0)}
        if self.chance(0.15):
            contact = self.opening_contact(scale)
        return self.tables(scale, self.choice((24, 48, 48, 192)), bonds, drive, contact)

    def decades(self):
        """Return a scene whose rates, speeds, sites and body are drawn over many decades."""
        scale = self.scale(self.log(1e-3, 100.0))
        bonds = self.interface(scale, self.log(1e-4, 1e3) / scale.duration, decades=1e4)
        drive = self.pull(
            scale, bonds, self.choice(("spring", "spring", "force")), decades=1e4
        )
        contact, steps = self.contact(scale), self.choice((3, 20, 100))
        if self.chance(0.4):
            contact, steps = self.opening_contact(scale), self.choice((20, 100))
        if contact.get("model") == "rate_dependent":
            contact["front_speed"] = scale.size / scale.duration * self.log(1e-3, 1e4)
        shear = self.shear(scale) if self.chance(0.3) else {"model": "uniform"}
        return self.tables(scale, steps, bonds, drive, contact) | {"shear": shear}

    def events(self):
        """Return a scene of many tracked bonds and two clock steps, so long that each has a million events."""
        scale = self.scale(self.log(0.1, 10.0))
        rate, ratio, sites = (
            self.log(1e-2, 1e2) / scale.duration,
            self.log(0.1, 10.0),
            int(self.log(100.0, 3e3)),
        )
        wanted = self.log(*MANY_EVENTS)
        rate = wanted / (0.5 * scale.duration * sites) * (1.0 + ratio) / (2.0 * ratio)
        bonds = self.interface(
            scale, rate, "tracked", stretched=True, ratio=ratio, slow=True
        )
        bonds.table |= {"sites": sites, "start": "steady"}
        drive = self.pull(
            scale, bonds, self.choice(("spring", "spring", "force")), body=False
        )
        if drive["model"] == "force":
            drive["force"] = bonds.force * self.log(1e-3, 0.1)
        scene = self.tables(
            scale,
            2,
            bonds,
            drive,
            {"load": scale.force * self.random.uniform(0.0, 3.0)},
        )
        # otherwise each event costs a time that grows with the sites
        scene["adhesion"]["bond_share"] = 0.0
        return scene | {"ensemble": {"members": 2}}

    def scale(self, duration):
        """Return the scales of a contact that is drawn over decades."""
        modulus, radius, work = (
            self.log(3e4, 1e7),
            self.log(1e-4, 1e-2),
            self.log(3e-3, 0.2),
        )
        size = (9.0 * math.pi * work * radius**2 / (8.0 * modulus)) ** (1.0 / 3.0)
        return Scale(
            modulus,
            radius,
            work,
            size,
            1.5 * math.pi * work * radius,
            duration,
            self.log(0.1, 30.0) * size,
        )

    def tables(self, scale, steps, bonds, drive, contact):
        share = float(self.choice((0.0, 0.5, 1.0, 1.0)))
        return {
            "clock": {"duration": scale.duration, "step": scale.duration / int(steps)},
            "solid": {"shear_modulus": scale.modulus},
            "sphere": {"radius": scale.radius},
            "adhesion": {"work": scale.work, "bond_share": share},
            "contact": contact,
            "drive": drive,
            "bonds": bonds.table,
            "ensemble": {"members": 3},
        }

    def opening_contact(self, scale):
        """Return a contact under a load, an indentation or a displacement that draws it off and mostly back again."""
        depth = scale.size**2 / scale.radius
        stiffness = 4.0 * scale.modulus * scale.size * self.log(1e-2, 1e2)
        far = 3.0 * depth + 3.0 * scale.force / stiffness
        control, press, draw = self.choice(
            (
                (
                    "load",
                    scale.force * self.random.uniform(-0.3, 2.0),
                    -scale.force * self.random.uniform(1.0, 2.5),
                ),
                (
                    "load",
                    scale.force * self.random.uniform(-0.3, 2.0),
                    -scale.force * self.random.uniform(1.0, 2.5),
                ),
                (
                    "indentation",
                    depth * self.random.uniform(0.0, 2.0),
                    -depth * self.random.uniform(1.0, 3.0),
                ),
                (
                    "displacement",
                    depth * self.random.uniform(0.0, 2.0),
                    -far * self.random.uniform(0.7, 1.5),
                ),
            )
        )
        thirds = [
            0.0,
            scale.duration / 3.0,
            scale.duration / 3.0,
            0.7 * scale.duration,
            scale.duration,
        ]
        course = self.choice(
            (
                {"from": press, "to": draw},
                {"from": press, "to": draw, "cycles": 1},
                {"from": press, "to": draw, "cycles": 2},
                {"from": draw, "to": press, "cycles": 1},
                {"time": thirds, "value": [press, press, draw, draw, press]},
            )
        )
        contact = {
            control: course,
            "after_pull_off": self.choice(
                ("reattach", "reattach", "reattach", "stay_open")
            ),
        }
        return contact | ({"stiffness": stiffness} if control == "displacement" else {})

    def interface(
        self,
        scale,
        rate,
        model=None,
        stretched=None,
        ratio=None,
        slow=False,
        decades=1.0,
    ):
        """Return bonds of a model, or any, that break at a rate [1/s]; ``decades`` widens what is drawn."""
        stretched = self.chance(0.75) if stretched is None else stretched
        stress = scale.stress * self.log(0.01, 1.0)
        binding = rate * (
            self.log(0.1 / decades**0.5, 30.0 * decades**0.5)
            if ratio is None
            else ratio
        )
        life = scale.path * self.log(1e-3, 1.0)
        fast = (
            self.log(0.02, 0.5) if slow else self.log(0.05 / decades, 100.0 * decades)
        )
        rest = {"start": self.choice(("steady", "bonded", "empty"))}
        carried = {"area": self.choice(("present", "carried"))}
        if not stretched:
            law = {"stress": stress, "critical_speed": life * binding}
            model = self.choice(("none", "steady", "rate", "rate", "counted"))
            table = {"model": model} | (law if model != "none" else {"stress": stress})
            table |= (
                {"rebinding_rate": binding} | rest
                if model in ("rate", "counted")
                else {}
            )
            table |= (
                {"sites": int(self.log(1.0, 1e6))}
                if model == "counted"
                else carried
                if model == "rate"
                else {}
            )
            return Interface(table, scale, stress, life, life * binding * fast, False)
        if self.chance(0.05) and ratio is None:
            binding, rest = 0.0, {"start": "bonded"}
        force, model = (
            self.log(1e-12, 2e-11),
            model or self.choice(("rate", "cohort", "cohort", "tracked")),
        )
        ruptures = [
            {"model": "constant", "rate": rate},
            {"model": "bell", "zero_force_rate": rate, "bell_force": force},
            {"model": "bell", "zero_force_rate": rate, "bell_force": force},
            {"model": "cut_off", "stretch": life, "rate": rate},
        ]
        if model == "cohort":
            catch = {
                "catch_rate": rate,
                "catch_force": force,
                "slip_rate": 0.1 * rate,
                "slip_force": force,
            }
            ruptures.append({"model": "catch"} | catch)
        table = {
            "model": model,
            "rupture": self.choice(ruptures),
            "rebinding_rate": binding,
            "site_density": stress / force,
        }
        table |= {"bond_stiffness": force / life} | rest
        table |= {"sites": int(self.log(1.0, 300.0))} if model == "tracked" else carried
        return Interface(table, scale, stress, life, life * rate * fast, True)

    def pull(self, scale, bonds, model, body=True, decades=1.0):
        """Return a drive that pulls the slider by a spring or a force, with any ``body``, at the speed of the bonds."""
        drive, speed = {"model": model}, bonds.speed * self.choice((1.0, 1.0, -1.0))
        if model == "force":
            drive["force"] = self.course(
                bonds.force * self.log(1e-3, 1.0) * self.choice((1.0, 1.0, -1.0)),
                signed=False,
            )
        else:
            drive |= {
                "stage": self.course(speed),
                "stiffness": bonds.stiffness * self.log(3e-3 / decades, 3.0 * decades),
            }
            if self.chance(0.1):
                drive["start"] = "steady"
        if body:
            time = scale.duration * self.log(1e-3, 0.3)
            drive |= (
                {"mass": bonds.stiffness * time**2 * self.log(1e-2, 1.0 * decades)}
                if self.chance(0.4)
                else {}
            )
            drive |= (
                {"damping": bonds.stiffness * time * self.log(1e-4, 10.0)}
                if self.chance(0.5)
                else {}
            )
            viscous = bonds.stiffness * time / bonds.area * self.log(1e-4, 10.0)
            drive |= {"viscosity": viscous} if self.chance(0.25) else {}
            if not bonds.stretched and not drive.keys() & {
                "mass",
                "damping",
                "viscosity",
            }:
                # without it the speed of a slip is not determined
                drive["damping"] = bonds.stiffness * time
        yields = (
            "half_space",
            "half_space",
            "rigid",
            bonds.stiffness * self.log(0.03, 100.0),
        )
        return drive | {
            "contact_stiffness": self.choice(yields) if bonds.stretched else "rigid"
        }


class Interface:
    """Bonds and their measures: force of all [N], stiffness of all [N/m], sliding speed [m/s], contact area [m²]."""

    def __init__(self, table, scale, stress, life, speed, stretched):
        self.table, self.speed, self.stretched = table, speed, stretched
        self.area = math.pi * scale.size**2
        self.force = stress * self.area
        self.stiffness = self.force / life
