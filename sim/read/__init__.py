"""Statistics of a dataset: over its members, at each time and sweep value, and what they say about the area.

Everything is read from the file; only speeds in steady sliding of chosen losses are computed by the models. A ``Run``
knows the facts of a dataset and has the statistics of each quantity. *Observables* are variables per member and time;
some are recorded, others are derived (such as the share of the area lost to broken bonds). *Events* occur once in a
run, such as a pull-off. The statistics of a quantity are an ``Estimate``.
"""

from sim.read.correlation import IntegralTime, correlation_time, integral_time
from sim.read.dataset import (
    Control,
    control,
    is_stationary,
    is_steady,
    setting,
    speed_of,
    sweep_dims,
    where,
)
from sim.read.errors import SystematicError, remarks, systematic_errors
from sim.read.estimate import Estimate, Estimates
from sim.read.events import events, pull_offs
from sim.read.export import frame, long, to_csv, to_long_csv
from sim.read.late import distribution, over_time
from sim.read.lifetimes import Lifetime, lifetime, survival
from sim.read.loops import loop_energy
from sim.read.observables import (
    bond_work,
    observables,
    reference_radii,
    settled,
    share_observables,
)
from sim.read.over_speed import crossing, extremes, loss_speeds
from sim.read.peaks import ageing, peaks, peaks_after_holds
from sim.read.run import Run
from sim.read.slips import kinetic_friction, slips, slips_by_phase, stick_slip
from sim.read.statistics import QUANTILES, averaging, over_members, summary
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
    "Estimate",
    "Estimates",
    "IntegralTime",
    "Lifetime",
    "Run",
    "SystematicError",
    "Table",
    "ageing",
    "averaging",
    "bond_work",
    "concise",
    "control",
    "correlation_time",
    "crossing",
    "distribution",
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
    "over_members",
    "over_time",
    "peaks",
    "peaks_after_holds",
    "phases",
    "pull_offs",
    "reference_radii",
    "remarks",
    "scaled",
    "setting",
    "settled",
    "share_observables",
    "slips",
    "slips_by_phase",
    "speed_of",
    "spread",
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
