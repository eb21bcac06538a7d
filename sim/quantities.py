"""The registry of quantities: a row for each, which all that records, averages or prints a quantity reads."""

from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple


class Mean(Enum):
    """The mean over time that a quantity has."""

    #: That of all records.
    OF_ALL = "of all records"
    #: That of the records at which the contact is closed; the quantity is recorded as 0 while it is open.
    WHILE_CLOSED = "while closed"
    #: None, because the quantity grows over a run, or is a time or an event.
    NONE = "none"


class Form(Enum):
    """The form in which a number without a unit is printed; numbers with a unit are printed in it."""

    #: As it is: a count, or a ratio that people do not give in percent.
    PLAIN = "plain"
    #: In percent.
    PERCENT = "percent"
    #: In percent, at least 0 and at most 100.
    SHARE = "share"


class Condition(NamedTuple):
    """The scenes of which a quantity is recorded.

    Attributes
    ----------
    words : str
        The condition as a key of the scenario, or in words; empty for all scenes.
    holds : callable
        Takes a ``Scenario`` and returns True if the quantity is recorded of it.
    """

    words: str
    holds: Callable[[Any], bool]


ALWAYS = Condition("", lambda scene: True)
BEHIND_A_SPRING = Condition(
    'drive.model = "spring"', lambda scene: scene.drive.model == "spring"
)
AT_ONE_STAGE_SPEED = Condition(
    "a drive.stage at one speed",
    lambda scene: scene.drive.model == "spring" and not scene.drive.course.changes,
)
AT_RISING_OR_FALLING_STAGE_SPEED = Condition(
    "a drive.stage that gets faster or slower",
    lambda scene: (
        scene.drive.model == "spring"
        and any("ing speed" in name for name in scene.phases.names)
    ),
)
FROM_REST = Condition(
    "a start from rest or a hold, under a constant control of the contact",
    lambda scene: scene.loads_from_rest and not scene.contact.changes,
)
UNDER_A_FORCE = Condition(
    'drive.model = "force"', lambda scene: scene.drive.model == "force"
)
DRIVEN = Condition(
    'drive.model = "spring" or "force"', lambda scene: scene.drive.solves_motion
)
ONE_AREA = Condition(
    "members with different stresses, or one area",
    lambda scene: scene.varies["bonds"] == scene.varies["contact"],
)
ON_A_DISC = Condition('shear.contact = "disc"', lambda scene: scene.margin is not None)
REVERSIBLE = Condition(
    "contact.reversible above 0", lambda scene: scene.contact.reversible > 0.0
)
LAGGING_EDGE = Condition(
    'contact.model = "rate_dependent"', lambda scene: scene.contact.lags
)
WITH_ADHESION = Condition(
    "adhesion.work above 0", lambda scene: scene.adhesion.work > 0.0
)
WITH_RANGE = Condition(
    'contact.model = "cohesive"', lambda scene: scene.contact.model == "cohesive"
)
AT_A_LOAD = Condition("contact.load", lambda scene: scene.contact.load is not None)
CHANGING_APPLIED_LOAD = Condition(
    "a contact.load that changes",
    lambda scene: scene.contact.load is not None and scene.contact.changes,
)
CHANGING_LOAD = Condition("a load that changes", lambda scene: scene.contact.makes_load)
PLACED_AT_LOAD = Condition(
    f'{CHANGING_LOAD.words}, and not contact.load of contact.model = "cohesive"',
    lambda scene: (
        CHANGING_LOAD.holds(scene)
        and not (WITH_RANGE.holds(scene) and AT_A_LOAD.holds(scene))
    ),
)
KNOWN_ENERGY = Condition(
    "a field with a correlation, a prescribed motion, and an amplitude without a memory",
    lambda scene: scene.knows_energy,
)
FEELS_STEPS = Condition(
    "an edge that lags, or tension", lambda scene: scene.feels_steps
)
CAN_OPEN = Condition(
    "a load, indentation or displacement below zero",
    lambda scene: scene.contact.can_open,
)
CAN_JUMP_IN = Condition(
    f'{CAN_OPEN.words}, and contact.model other than "rate_dependent"',
    lambda scene: CAN_OPEN.holds(scene) and not scene.contact.lags,
)
LAGS_BEHIND_SPEED = Condition(
    "a speed that changes at a constant mount, and bonds or fluctuations that lag",
    lambda scene: scene.lags_behind_speed,
)
LATE_PULL_OFF = Condition(
    f"fluctuations or an edge that lags, and {CAN_OPEN.words}",
    lambda scene: CAN_OPEN.holds(scene) and (scene.feels_steps or scene.contact.lags),
)


#: Reasons for missing values that several quantities have.
ENDED = "the trajectory has ended"
OPEN = f"the contact is open, or {ENDED}"
NO_SLIP = "there is no slip event"
NO_RATIO = f"the contact or that of JKR is open, or {ENDED}"
NO_SLIPS = "there are no two slip events"
NO_ONSET = "slip events do not set in as the stage gets faster, or there are no two"
NO_END = "slip events do not end as the stage gets slower, or there are no two"
NO_MAXIMUM = (
    "friction does not fall by 1 % from its first maximum before it exceeds it or the "
    "stage slows down"
)
NO_PEAK = "the value at an end of the run is as large"
NO_STAGE, NO_PHASE = "no stage pulls the slider", "the run has no such phase"
NEVER_CLOSED = "the contact was never closed"
STAYS_CLOSED, NO_JUMP_IN = "the contact does not open", "no contact jumps in"
OPEN_THROUGHOUT = "the contact is open throughout the run"
#: Those of them that a contact which never closes does not have, because they are of a closed contact.
OF_A_CONTACT = (STAYS_CLOSED, NO_JUMP_IN, NO_PEAK, NO_MAXIMUM)
WITHOUT_TENSION = "the contact bears no tension"


class Definition(NamedTuple):
    """The definition of a quantity.

    Attributes
    ----------
    name : str
        Name of its variable in a dataset.
    unit : str
        SI unit, "1" for a number.
    meaning : str
        Meaning in a phrase, the ``long_name`` of the variable.
    symbol : str
        Symbol in mathtext, or empty.
    exists_when : Condition
        Scenes of which it is recorded.
    mean : Mean
        Mean over time that it has.
    heading : str
        Heading of its column in a table; empty if no table has one.
    form : Form
        Form in which it is printed.
    absent : str
        Reason if a value is missing, in words; empty if there is none but the kind of
        the run.
    """

    name: str
    unit: str
    meaning: str
    symbol: str = ""
    exists_when: Condition = ALWAYS
    mean: Mean = Mean.OF_ALL
    heading: str = ""
    form: Form = Form.PLAIN
    absent: str = ""


#: Statistics over the members that are recorded in place of these.
STATISTICS = ("mean", "standard deviation", "standard error")

#: Quantities over time, read at each record.
RECORDS: tuple[Definition, ...] = (
    Definition("speed", "m/s", "sliding speed", symbol="V", heading="V", absent=ENDED),
    Definition(
        "slider_position", "m", "displacement of the slider", symbol="X", mean=Mean.NONE
    ),
    Definition(
        "bond_fraction",
        "1",
        "number of bonds over that at rest",
        symbol="N/N_0",
        heading="N/N0",
        absent=ENDED,
    ),
    Definition(
        "shear_stress",
        "Pa",
        "mean shear stress at the interface",
        symbol="tau_0",
        absent=ENDED,
    ),
    Definition(
        "fluctuation_energy",
        "J/m^2",
        "elastic energy of the shear-stress fluctuations per area",
        symbol="DeltaGamma",
        heading="ΔΓ",
        absent=ENDED,
    ),
    Definition(
        "expected_energy",
        "J/m^2",
        "mean of the fluctuation energy over all realisations, in closed form",
        exists_when=KNOWN_ENERGY,
    ),
    Definition(
        "edge_energy",
        "J/m^2",
        "fluctuation energy per unit of new contact area at the edge of the disc",
        symbol="dE/dA",
        exists_when=ON_A_DISC,
        heading="edge",
        absent=ENDED,
    ),
    Definition(
        "work_of_adhesion",
        "J/m^2",
        "effective work of adhesion",
        symbol="w",
        heading="w",
        absent=OPEN,
    ),
    Definition(
        "contact_radius",
        "m",
        "contact radius",
        symbol="a",
        mean=Mean.WHILE_CLOSED,
        heading="a",
        absent=OPEN,
    ),
    Definition(
        "outer_radius",
        "m",
        "radius within which the surfaces touch or attract each other; 0 beyond reach",
        symbol="c",
        exists_when=WITH_RANGE,
        absent=ENDED,
    ),
    Definition(
        "contact_area",
        "m^2",
        "contact area",
        symbol="A",
        mean=Mean.WHILE_CLOSED,
        absent=OPEN,
    ),
    Definition(
        "normal_load",
        "N",
        "normal load on the sphere, compression positive",
        symbol="P",
        mean=Mean.WHILE_CLOSED,
        heading="P",
        absent=OPEN,
    ),
    Definition(
        "indentation", "m", "indentation of the sphere", symbol="delta", absent=OPEN
    ),
    Definition(
        "displacement",
        "m",
        "displacement of the mount",
        symbol="Delta",
        heading="Δ",
        absent=OPEN,
    ),
    Definition(
        "friction_force",
        "N",
        "friction force, shear stress times contact area",
        symbol="F",
        mean=Mean.WHILE_CLOSED,
        heading="F",
        absent=OPEN,
    ),
    Definition("in_contact", "1", "1 if the contact is closed"),
    Definition(
        "masked",
        "1",
        "1 if a closed contact has no positive effective work of adhesion (Hertz)",
        exists_when=WITH_ADHESION,
        absent=OPEN,
    ),
    Definition(
        "detachment_time",
        "s",
        "time of the last detachment",
        symbol="t_d",
        mean=Mean.NONE,
    ),
    Definition(
        "dissipated_energy",
        "J",
        "energy dissipated by the edge and the jumps of the contact, without openings under a load",
        symbol="W",
        mean=Mean.NONE,
        heading="W",
        absent=ENDED,
    ),
    Definition(
        "jkr_radius",
        "m",
        (
            "equilibrium radius at the full work of adhesion, with the same mount and "
            "rule after pull-off; 0 while that contact is open"
        ),
        symbol="a_JKR",
    ),
    Definition(
        "hertz_radius",
        "m",
        "radius without adhesion, with the same mount; 0 without compression",
        symbol="a_H",
    ),
    Definition(
        "bonds_radius",
        "m",
        (
            "equilibrium radius at the work of adhesion of the bonds alone, with the "
            "same mount and rule after pull-off; 0 while that contact is open"
        ),
        symbol="a_b",
    ),
    Definition(
        "fluctuations_radius",
        "m",
        (
            "equilibrium radius at the work of adhesion after the fluctuations and "
            "before the mean stress, with the same mount and rule after pull-off; 0 "
            "while that contact is open"
        ),
        symbol="a_f",
        exists_when=REVERSIBLE,
    ),
    Definition(
        "equilibrium_radius",
        "m",
        (
            "equilibrium radius at the effective work of adhesion, with the same mount "
            "and rule after pull-off; 0 while that contact is open"
        ),
        symbol="a_e",
        exists_when=LAGGING_EDGE,
    ),
    Definition(
        "applied_load",
        "N",
        "load applied to the sphere, in contact or open",
        symbol="P_a",
        exists_when=CHANGING_APPLIED_LOAD,
    ),
    Definition(
        "stage_position",
        "m",
        "displacement of the stage",
        symbol="X_s",
        exists_when=BEHIND_A_SPRING,
        mean=Mean.NONE,
    ),
    Definition(
        "stage_speed",
        "m/s",
        "speed of the stage",
        symbol="V_s",
        exists_when=BEHIND_A_SPRING,
        heading="stage",
        absent=f"{NO_STAGE}, or {ENDED}",
    ),
    Definition(
        "spring_force",
        "N",
        "force of the spring on the body, or the prescribed force",
        symbol="Q",
        exists_when=DRIVEN,
    ),
    Definition(
        "drive_work",
        "J",
        "work of the stage or of the prescribed force",
        symbol="W_d",
        exists_when=DRIVEN,
        mean=Mean.NONE,
    ),
    Definition(
        "stored_energy",
        "J",
        "energy of spring, mass, yielding contact and bonds",
        symbol="U",
        exists_when=DRIVEN,
    ),
    Definition(
        "dissipated_by_damping",
        "J",
        "energy dissipated by the damping of the body",
        symbol="W_c",
        exists_when=DRIVEN,
        mean=Mean.NONE,
    ),
    Definition(
        "dissipated_by_viscosity",
        "J",
        "energy dissipated by the viscosity of the interface",
        symbol="W_v",
        exists_when=DRIVEN,
        mean=Mean.NONE,
    ),
    Definition(
        "dissipated_by_rupture",
        "J",
        "energy dissipated as bonds break and form",
        symbol="W_b",
        exists_when=DRIVEN,
        mean=Mean.NONE,
    ),
    Definition(
        "dissipated_by_snaps",
        "J",
        (
            "energy dissipated in instantaneous slips, except that of the bonds: "
            "avalanches and jumps of the force"
        ),
        symbol="W_s",
        exists_when=DRIVEN,
        mean=Mean.NONE,
    ),
    Definition(
        "dissipated_by_area",
        "J",
        "stored energy of the area that is lost, minus that of the area gained",
        symbol="W_A",
        exists_when=DRIVEN,
        mean=Mean.NONE,
    ),
    Definition(
        "energy_residual",
        "J",
        (
            "work of the drive minus the increase of stored energy and the dissipated "
            "energy"
        ),
        symbol="W_0",
        exists_when=DRIVEN,
        mean=Mean.NONE,
    ),
    Definition(
        "substeps",
        "1",
        "number of sub-steps since the start",
        exists_when=DRIVEN,
        mean=Mean.NONE,
    ),
    Definition(
        "runaway_time",
        "s",
        "time at which the slider lost stability",
        symbol="t_r",
        exists_when=UNDER_A_FORCE,
        mean=Mean.NONE,
    ),
)

#: Quantities over time that follow from recorded ones.
DERIVED: tuple[Definition, ...] = (
    Definition(
        "area_ratio",
        "1",
        "contact area over that at the full work of adhesion",
        symbol="A/A_JKR",
        heading="A/A_JKR",
        form=Form.PERCENT,
        absent=NO_RATIO,
    ),
    Definition(
        "lost_to_bonds",
        "1",
        "share of the JKR area lost to broken bonds, which are subtracted first",
        heading="lost to bonds",
        form=Form.PERCENT,
        absent=NO_RATIO,
    ),
    Definition(
        "lost_to_fluctuations",
        "1",
        (
            "share of the JKR area lost to fluctuations, which are subtracted after the "
            "bonds; by the paper's strict energy balance there is no such loss"
        ),
        heading="lost to fluct.",
        form=Form.PERCENT,
        absent=NO_RATIO,
    ),
    Definition(
        "lost_to_fluctuations_first",
        "1",
        "share of the JKR area lost to fluctuations, if they are subtracted first",
        heading="fluct. first",
        form=Form.PERCENT,
        absent=NO_RATIO,
    ),
    Definition(
        "lost_to_bonds_last",
        "1",
        (
            "share of the JKR area lost to broken bonds, if they are subtracted after "
            "the fluctuations"
        ),
        heading="bonds last",
        form=Form.PERCENT,
        absent=NO_RATIO,
    ),
    Definition(
        "lost_to_mean_stress",
        "1",
        (
            "share of the JKR area lost to the mean stress, which is subtracted after "
            "bonds and fluctuations"
        ),
        exists_when=REVERSIBLE,
        heading="lost to stress",
        form=Form.PERCENT,
        absent=NO_RATIO,
    ),
    Definition(
        "lost_to_lag",
        "1",
        (
            "share of the JKR area lost to the lag of the edge, which is subtracted "
            "last; negative if the edge retreats late"
        ),
        exists_when=LAGGING_EDGE,
        heading="lost to lag",
        form=Form.PERCENT,
        absent=NO_RATIO,
    ),
    Definition(
        "order_of_charging",
        "1",
        (
            "additional share of the JKR area lost to fluctuations if they are "
            "subtracted first"
        ),
        form=Form.PERCENT,
    ),
    Definition(
        "fraction_detached",
        "1",
        "share of open contacts",
        heading="open",
        form=Form.SHARE,
        absent=ENDED,
    ),
    Definition(
        "fraction_masked",
        "1",
        "share of closed contacts without effective work of adhesion",
        heading="masked",
        form=Form.SHARE,
        absent=f"no contact is closed, or {ENDED}",
        exists_when=WITH_ADHESION,
    ),
    Definition(
        "correlation_time",
        "s",
        "integral correlation time of the fluctuation energy",
        symbol="t_c",
        heading="t_c",
    ),
)

#: Quantities of an event, of the whole run and of each of its phases.
WITH_PHASES: tuple[Definition, ...] = (
    Definition(
        "peak_stress",
        "Pa",
        (
            "largest magnitude of the mean shear stress of the run, of the highest "
            "start; open contacts included"
        ),
        symbol="tau_p",
        heading="peak of stress",
        absent=NO_PEAK,
    ),
    Definition(
        "peak_time",
        "s",
        "time of the largest shear stress",
        symbol="t_p",
        heading="peak of stress after",
        absent=NO_PEAK,
    ),
    Definition(
        "peak_speed",
        "m/s",
        "sliding speed at the largest shear stress",
        heading="peak of stress at V",
        absent=NO_PEAK,
    ),
    Definition(
        "peak_area",
        "m^2",
        "contact area at the largest shear stress",
        exists_when=ONE_AREA,
    ),
    Definition(
        "peak_friction",
        "N",
        "largest magnitude of the friction force of the run, of the highest start",
        symbol="F_p",
        heading="peak of friction",
        absent=NO_PEAK,
    ),
    Definition(
        "peak_friction_time",
        "s",
        "time of the largest friction force",
        heading="peak of friction after",
        absent=NO_PEAK,
    ),
    Definition(
        "peak_friction_speed",
        "m/s",
        "sliding speed at the largest friction force",
        heading="peak of friction at V",
        absent=NO_PEAK,
    ),
    Definition(
        "peak_friction_area", "m^2", "contact area at the largest friction force"
    ),
    Definition(
        "static_threshold",
        "N",
        (
            "first maximum of the friction force after a rest, if it then falls by 1 % "
            "before it exceeds the maximum or the stage slows down; else nan"
        ),
        symbol="F_s",
        exists_when=FROM_REST,
        absent=NO_MAXIMUM,
        heading="static threshold",
    ),
    Definition(
        "static_threshold_time",
        "s",
        "time of the first maximum of the friction force after a rest",
        exists_when=FROM_REST,
        absent=NO_MAXIMUM,
    ),
    Definition(
        "static_threshold_area",
        "m^2",
        "contact area at the first maximum of the friction force after a rest",
        exists_when=FROM_REST,
        absent=NO_MAXIMUM,
    ),
    Definition(
        "pull_off_time",
        "s",
        "time of the first pull-off",
        symbol="t_c",
        exists_when=CAN_OPEN,
        heading="pull-off after",
        absent=STAYS_CLOSED,
    ),
    Definition(
        "pull_off_load",
        "N",
        "normal load at the first pull-off",
        symbol="P_off",
        exists_when=CAN_OPEN,
        heading="pull-off load",
        absent=STAYS_CLOSED,
    ),
    Definition(
        "pull_off_displacement",
        "m",
        "displacement of the mount at the first pull-off",
        exists_when=CAN_OPEN,
        absent=STAYS_CLOSED,
    ),
)

#: Other quantities of a whole run, read at its end.
OF_THE_RUN: tuple[Definition, ...] = (
    Definition("detachments", "1", "number of detachments"),
    Definition(
        "lowest_load",
        "N",
        "lowest normal load that the contact bears, a tension",
        symbol="P_min",
        exists_when=CHANGING_LOAD,
        heading="lowest load",
        absent=WITHOUT_TENSION,
    ),
    Definition(
        "lowest_load_time",
        "s",
        "time of the lowest normal load",
        symbol="t_min",
        exists_when=CHANGING_LOAD,
        absent=WITHOUT_TENSION,
    ),
    Definition(
        "lowest_load_displacement",
        "m",
        "displacement of the mount at the lowest normal load",
        exists_when=PLACED_AT_LOAD,
        absent=WITHOUT_TENSION,
    ),
    Definition(
        "jump_in_time",
        "s",
        "time of the first jump into contact",
        exists_when=CAN_JUMP_IN,
        absent=NO_JUMP_IN,
    ),
    Definition(
        "jump_in_load",
        "N",
        "normal load just after the first jump into contact",
        exists_when=CAN_JUMP_IN,
        heading="jump-in load",
        absent=NO_JUMP_IN,
    ),
    Definition(
        "jump_in_displacement",
        "m",
        "displacement of the mount at the first jump into contact",
        exists_when=CAN_JUMP_IN,
        absent=NO_JUMP_IN,
    ),
    Definition(
        "first_detachment",
        "s",
        "end of the clock step in which the contact first opens",
        symbol="t_d",
        absent=STAYS_CLOSED,
    ),
    Definition(
        "first_closing",
        "s",
        "end of the clock step in which an open contact first closes",
        absent="no open contact closes",
    ),
    Definition(
        "first_masked",
        "s",
        "time at which the contact is first masked",
        absent="the contact is never masked",
        exists_when=WITH_ADHESION,
    ),
    Definition(
        "time_masked",
        "1",
        "share of the closed time in which the contact is masked",
        heading="masked, of the time",
        form=Form.SHARE,
        absent=NEVER_CLOSED,
        exists_when=WITH_ADHESION,
    ),
    Definition(
        "runaway_force",
        "N",
        "force at which the slider lost stability; nan if it never did",
        exists_when=UNDER_A_FORCE,
    ),
    Definition(
        "unresolved_time",
        "s",
        (
            "time from which on the motion of the slider could not be resolved, so "
            "that its values are missing; nan if it was resolved to the end"
        ),
        exists_when=DRIVEN,
    ),
    Definition(
        "step_renewal",
        "1",
        "largest share of the variance of DeltaGamma renewed in a clock step",
        exists_when=FEELS_STEPS,
    ),
    Definition(
        "pull_off_error",
        "N",
        "approximate systematic error of the pull-off load by the clock step",
        exists_when=LATE_PULL_OFF,
        absent=STAYS_CLOSED,
    ),
)

#: Quantities of each slip event.
OF_EACH_SLIP: tuple[Definition, ...] = (
    Definition(
        "slip_time",
        "s",
        "time at which a slip event begins",
        symbol="t_s",
        exists_when=BEHIND_A_SPRING,
    ),
    Definition(
        "slip_end",
        "s",
        "time at which a slip event ends, at the smallest spring force",
        exists_when=BEHIND_A_SPRING,
    ),
    Definition(
        "slip_amplitude",
        "m",
        "displacement of the slider in a slip event",
        symbol="S",
        exists_when=BEHIND_A_SPRING,
        absent=NO_SLIP,
        heading="slip",
    ),
    Definition(
        "slip_speed",
        "m/s",
        "speed of the stage at the start of a slip event",
        exists_when=BEHIND_A_SPRING,
    ),
    Definition(
        "slip_force_before",
        "N",
        (
            "largest spring force between the previous slip event and this one, "
            "positive along the stage motion"
        ),
        symbol="Q_s",
        exists_when=BEHIND_A_SPRING,
    ),
    Definition(
        "slip_force_after",
        "N",
        "spring force at the end of a slip event, positive along the stage motion",
        exists_when=BEHIND_A_SPRING,
    ),
    Definition(
        "slip_stress_before",
        "Pa",
        "largest shear stress since the previous slip event",
        exists_when=BEHIND_A_SPRING,
    ),
    Definition(
        "slip_stress_after",
        "Pa",
        "smallest shear stress in a slip event",
        exists_when=BEHIND_A_SPRING,
    ),
)

#: Quantities of slip events, and their moments over the second half of the run.
OF_SLIPS: tuple[Definition, ...] = (
    *OF_EACH_SLIP,
    Definition(
        "slip_count",
        "1",
        (
            "number of slip events; in tables of a stage at one speed that of those "
            "which begin in the second half of the run"
        ),
        exists_when=BEHIND_A_SPRING,
        heading="slips",
        absent=NO_STAGE,
    ),
    Definition(
        "slow_fall_count",
        "1",
        (
            "number of falls of the spring force as in a slip event, in which the "
            "slider is not ten times as fast as the stage"
        ),
        exists_when=BEHIND_A_SPRING,
    ),
    Definition(
        "slip_count_late",
        "1",
        "number of slip events that begin in the second half of the run",
        exists_when=AT_ONE_STAGE_SPEED,
    ),
    *(
        Definition(
            f"late_{name}_{moment}",
            unit,
            f"{words} over slip events that begin in the second half of the run: {text}",
            exists_when=AT_ONE_STAGE_SPEED,
        )
        for name, unit, text in (
            ("force_before", "N", "largest spring force since the slip event before"),
            ("force_drop", "N", "drop of the spring force by a slip event"),
            ("amplitude", "m", "displacement of the slider in a slip event"),
            ("recurrence", "s", "time from the start of a slip event to the next one"),
        )
        for moment, words in (
            ("mean", "mean"),
            ("std", "standard deviation"),
            ("least", "smallest"),
            ("largest", "largest"),
        )
    ),
    Definition(
        "kinetic_friction",
        "N",
        (
            "work of the stage over its path, from the first slip event in the second "
            "half of the run to the last; without slip events over the second half"
        ),
        symbol="F_k",
        exists_when=AT_ONE_STAGE_SPEED,
        absent="the motion has not settled",
        heading="kinetic friction",
    ),
    Definition(
        "kinetic_friction_change",
        "N",
        "change of the kinetic friction at about three quarters of the run",
        exists_when=AT_ONE_STAGE_SPEED,
    ),
    Definition(
        "onset_steady_speed",
        "m/s",
        (
            "speed of a stage that gets faster one recurrence time before its first "
            "slip event; nan without two slip events, and if they begin at the start"
        ),
        exists_when=AT_RISING_OR_FALLING_STAGE_SPEED,
        absent=NO_ONSET,
        heading="no slips up to",
    ),
    Definition(
        "onset_slip_speed",
        "m/s",
        "speed of a stage that gets faster at its first slip event",
        exists_when=AT_RISING_OR_FALLING_STAGE_SPEED,
        absent=NO_ONSET,
        heading="slips from",
    ),
    Definition(
        "end_slip_speed",
        "m/s",
        "speed of a stage that gets slower at its last slip event",
        exists_when=AT_RISING_OR_FALLING_STAGE_SPEED,
        absent=NO_END,
        heading="slips down to",
    ),
    Definition(
        "end_steady_speed",
        "m/s",
        (
            "speed of a stage that gets slower one recurrence time after its last slip "
            "event; nan without two slip events, and if they last to the end"
        ),
        exists_when=AT_RISING_OR_FALLING_STAGE_SPEED,
        absent=NO_END,
        heading="no slips from",
    ),
)

#: Shares of JKR's area whose loss has a speed, by the endings of names; None for half of all that can be lost.
LOST: dict[str, float | None] = {
    "at_5_percent_lost": 0.05,
    "at_50_percent_lost": 0.5,
    "halfway_to_hertz": None,
}


def loss_in_words(share: float | None) -> str:
    """Return a share of the loss in words."""
    if share is None:
        return "half of the JKR area above the Hertz area"
    return f"{100 * share:g} % of JKR's"


#: Numbers of a scene, written for each point of a sweep.
NUMBERS: tuple[Definition, ...] = (
    Definition("contact_modulus", "Pa", "contact modulus", symbol="E*"),
    Definition(
        "effective_shear_modulus",
        "Pa",
        "shear modulus of the tangential compliance",
        symbol="G",
    ),
    Definition(
        "effective_poisson_ratio",
        "1",
        "Poisson ratio of the tangential compliance",
        symbol="nu",
    ),
    Definition("softer_shear_modulus", "Pa", "shear modulus of the softer body"),
    Definition(
        "has_noise", "1", "1 if the scenario has random parts, so that members differ"
    ),
    Definition(
        "radius_at_rest", "m", "JKR radius at the full work of adhesion", symbol="a_0"
    ),
    Definition("radius_without_adhesion", "m", "Hertz radius", symbol="a_H"),
    Definition(
        "energy_variation",
        "1",
        "standard deviation of the fluctuation energy over its mean, in closed form",
        exists_when=KNOWN_ENERGY,
    ),
    Definition(
        "jkr_pull_off_load",
        "N",
        "load at pull-off with the full work of adhesion",
        symbol="P_c",
        exists_when=AT_A_LOAD,
    ),
    *(
        Definition(
            f"{kind}_speed_{name}",
            "m/s",
            f"speed at which steady sliding{words} loses {loss_in_words(share)}",
            exists_when=LAGS_BEHIND_SPEED,
        )
        for name, share in LOST.items()
        for kind, words in (("steady", ""), ("unstable", ", where it is unstable,"))
    ),
)

#: Quantities of events over members, cycles or slip events, which follow from recorded ones.
OF_MEMBERS: tuple[Definition, ...] = (
    Definition(
        "ever_detached",
        "1",
        "share of members whose contact opened",
        heading="detached, of members",
        form=Form.SHARE,
    ),
    Definition(
        "half_detached",
        "s",
        "time at which half of the members had detached",
        heading="half detached",
        absent="fewer than half of the members detached",
    ),
    Definition(
        "detached_rate",
        "1/s",
        "detachments per time in contact, of all members",
        heading="rate of detaching",
        absent=NEVER_CLOSED,
    ),
    Definition(
        "ever_masked",
        "1",
        "share of members that were masked at some time",
        heading="masked, of members",
        form=Form.SHARE,
        exists_when=WITH_ADHESION,
    ),
    Definition(
        "half_masked",
        "s",
        "time at which half of the members had been masked",
        heading="half masked",
        absent="fewer than half of the members were masked",
        exists_when=WITH_ADHESION,
    ),
    Definition(
        "masked_rate",
        "1/s",
        "first maskings per time before them, of all members",
        exists_when=WITH_ADHESION,
    ),
    Definition(
        "loop_energy",
        "J",
        "work of the mount in a cycle, the integral of load over displacement",
        heading="∫P dΔ, per cycle",
        absent="a cycle is not closed",
    ),
    Definition(
        "loop_dissipation",
        "J",
        "energy dissipated by opening and closing in a cycle",
        heading="dissipated, per cycle",
        absent="a cycle is not closed",
    ),
    Definition(
        "total_dissipated",
        "J",
        "energy dissipated by opening and closing to the end of the run",
        symbol="W",
        heading="dissipated, in all",
        absent=(
            "a contact has opened under a load, which moves the free sphere away, so "
            "that the energy lost then is not defined"
        ),
    ),
    Definition("pull_offs", "1", "number of phases with a pull-off"),
    Definition(
        "area_at_threshold",
        "1",
        "contact area at the static threshold over that of JKR theory at rest",
        heading="A/A_JKR there",
        form=Form.PERCENT,
        absent=NO_MAXIMUM,
    ),
    Definition(
        "threshold_after",
        "s",
        "time of the static threshold",
        absent=NO_MAXIMUM,
    ),
    Definition(
        "hold_growth",
        "N",
        "growth of the peak after a hold over a decade of the time held",
        heading="growth per decade held",
        absent=(
            "the peak after a hold saturates or does not grow, or members differ too much"
        ),
    ),
    Definition(
        "hold_saturation",
        "s",
        "time held after which the peak grows by less than a tenth of its growth in the first decade",
        heading="saturates after",
        absent=(
            "the peak after a hold grows in the last decade by a tenth of the growth in "
            "the first or more, or not in the first, or members differ too much"
        ),
    ),
    Definition(
        "static_friction",
        "N",
        "largest force before a slip event, or force at which the slider lost stability",
        heading="static friction",
        absent="there is neither a slip event nor a loss of stability",
    ),
    Definition(
        "force_drop",
        "N",
        "drop of the spring force in a slip event",
        heading="drop",
        absent=NO_SLIP,
    ),
    Definition(
        "slip_spread",
        "1",
        "standard deviation of the slips over their mean",
        heading="spread of slips",
        form=Form.PERCENT,
        absent=NO_SLIP,
    ),
    Definition(
        "slip_duration",
        "s",
        "duration of a slip event",
        heading="slip lasts",
        absent=NO_SLIP,
    ),
    Definition(
        "stick_duration",
        "s",
        "duration of a stick phase",
        heading="stick lasts",
        absent=NO_SLIPS,
    ),
    Definition(
        "recurrence_time",
        "s",
        "time between the starts of two slip events",
        heading="slip every",
        absent=NO_SLIPS,
    ),
    Definition(
        "ran_away",
        "1",
        "share of members that lost stability",
        heading="lost stability, of members",
        form=Form.SHARE,
    ),
    Definition(
        "runaway_after",
        "s",
        "time at which members lost stability, if all of them did",
        heading="lost stability after",
        absent="no member lost stability",
    ),
)

#: Quantities of the slip events in a phase of the course of a stage.
OF_PHASES: tuple[Definition, ...] = (
    Definition(
        "phase_start", "s", "start of the phase", heading="starts", absent=NO_PHASE
    ),
    Definition(
        "phase_time_held",
        "s",
        "time at rest before the phase",
        heading="held before",
        absent="there was no rest before",
    ),
    Definition(
        "phase_slip_count",
        "1",
        "number of slip events in the phase",
        heading="slips",
        absent=NO_PHASE,
    ),
    Definition(
        "phase_peak_after_hold",
        "N",
        "first maximum of the friction force after a hold",
        heading="peak after the hold",
        absent="there was no hold before, or friction does not fall by 1 % from it",
    ),
    Definition(
        "phase_static_friction",
        "N",
        "mean of the largest spring force before each slip event of the phase",
        heading="static friction",
        absent=NO_SLIP,
    ),
    Definition(
        "phase_force_drop",
        "N",
        "mean drop of the spring force in slip events of the phase",
        heading="drop",
        absent=NO_SLIP,
    ),
    Definition(
        "phase_recurrence_time",
        "s",
        "mean time between the starts of slip events of the phase",
        heading="slip every",
        absent=NO_SLIPS,
    ),
)


def in_a_phase(event: Definition) -> Definition:
    """Return the definition of a quantity of an event in each phase from that of the whole run."""
    name = f"phase_{event.name.removeprefix('first_')}"
    meaning = f"in a phase: {event.meaning}".replace("of the run", "of it")
    return event._replace(name=name, meaning=meaning, symbol="", heading="")


#: Quantities of a whole run, in the order in which a dataset has them.
EVENTS = (*WITH_PHASES, *OF_THE_RUN, *map(in_a_phase, WITH_PHASES), *OF_SLIPS)
#: Quantities by their names.
QUANTITIES = {
    row.name: row
    for row in (*RECORDS, *DERIVED, *EVENTS, *NUMBERS, *OF_MEMBERS, *OF_PHASES)
}
#: Names of the quantities among which ``record.quantities`` chooses.
RECORDED = tuple(row.name for row in (*RECORDS, *EVENTS))


def has_mean(name: str) -> bool:
    """Return True if a quantity has a mean over time; derived ones have."""
    return name not in QUANTITIES or QUANTITIES[name].mean is not Mean.NONE


#: Names of the quantities of each slip event, without ``slip_``.
SLIP_EVENT = tuple(row.name.removeprefix("slip_") for row in OF_EACH_SLIP)
#: Names of the recorded quantities that only a closed contact has.
OF_CONTACT = tuple(row.name for row in RECORDS if row.mean is Mean.WHILE_CLOSED)

#: What leaves something out, by the first word of its errors.
SOURCES = {"cell": "cell", "banded": "bands", "step": "clock step"}
#: Systematic errors of a run, known before it.
ERRORS = (
    *(
        Definition(
            f"{name}_error_{of}",
            "1",
            f"{words} by the {source}, at the largest error of the area",
        )
        for of, words in (
            ("area", "error of the mean A/A_JKR"),
            ("friction", "relative error of the mean friction"),
        )
        for name, source in SOURCES.items()
    ),
    Definition(
        "error_speed",
        "m/s",
        "sliding speed at which systematic errors of the area are largest",
    ),
    Definition(
        "member_spread_area",
        "1",
        "standard deviation of A/A_JKR between members at that speed",
    ),
)
#: A recorded stress map.
MAP = Definition("shear_map", "Pa", "shear-stress fluctuation", "tau_1")
