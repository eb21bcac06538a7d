"""Statistics of a dataset: over its members, at each time and sweep value, and what they say about the area.

Everything is read from the file; nothing of the simulation is needed. *Observables* are variables per member and time.
Some are recorded, others are derived (such as the share of the area lost to broken bonds). *Events* occur once in a
run, such as the detachment or the friction peak. ``summary`` returns statistics of both over the members.
"""

from sim.read.dataset import (
    Control,
    control,
    is_stationary,
    is_steady,
    setting,
    speed_of,
    sweep_dims,
)
from sim.read.errors import SystematicError, remarks, systematic_errors
from sim.read.events import (
    Lifetime,
    events,
    kinetic_friction,
    lifetime,
    loop_energy,
    peaks,
    peaks_after_holds,
    pull_offs,
    slips,
    slips_by_phase,
    stick_slip,
    survival,
)
from sim.read.export import frame, long, to_csv, to_long_csv
from sim.read.observables import (
    bond_work,
    observables,
    reference_radii,
    settled,
    share_observables,
)
from sim.read.over_speed import crossing, extremes, loss_speeds
from sim.read.run import Run, statements
from sim.read.statements import Statement, each, relaxation, statistics
from sim.read.statistics import (
    QUANTILES,
    IntegralTime,
    averaging,
    correlation_time,
    distribution,
    integral_time,
    over_time,
    shares,
    summary,
    where,
)
from sim.read.tables import (
    GROUPS,
    Table,
    highlights,
    losses,
    notes,
    phases,
    spread,
    table,
    tables_of,
)
from sim.units.notation import concise, engineering, scaled

__all__ = [
    "GROUPS",
    "QUANTILES",
    "Control",
    "IntegralTime",
    "Lifetime",
    "Run",
    "Statement",
    "SystematicError",
    "Table",
    "averaging",
    "bond_work",
    "concise",
    "control",
    "correlation_time",
    "crossing",
    "distribution",
    "each",
    "engineering",
    "events",
    "extremes",
    "frame",
    "highlights",
    "integral_time",
    "is_stationary",
    "is_steady",
    "kinetic_friction",
    "lifetime",
    "long",
    "loop_energy",
    "loss_speeds",
    "losses",
    "notes",
    "observables",
    "over_time",
    "peaks",
    "peaks_after_holds",
    "phases",
    "pull_offs",
    "reference_radii",
    "relaxation",
    "remarks",
    "scaled",
    "setting",
    "settled",
    "share_observables",
    "shares",
    "slips",
    "slips_by_phase",
    "spread",
    "statements",
    "statistics",
    "stick_slip",
    "summary",
    "survival",
    "sweep_dims",
    "systematic_errors",
    "table",
    "tables_of",
    "to_csv",
    "to_long_csv",
    "where",
]


def __dir__() -> list[str]:
    return __all__
