"""Speed against error of one scene: ``sim converge``.

A *setting* changes one thing of the scene: the shear model, the bond model or the clock step. The scene is run at each
setting and at a finer one, and the difference is the error of the setting. If members differ, both runs have the same
members and differences are paired, so that part of the noise cancels. Errors of several changes add up.

At a prescribed speed, means and standard deviations over the members are compared at all recorded times. Under a spring
or a force single paths diverge, so averages over the second half of the run are compared.
"""

import contextlib
import functools
import importlib.metadata
import itertools
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, cast

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from sim.ensemble.plan import seconds_a_step, together
from sim.ensemble.variables import READ
from sim.numerics import files, hdf5, lazy
from sim.numerics.stopwatch import stopwatch
from sim.parts.drive import Driven
from sim.parts.exchange import Array, Bonding, Gammas, Motion
from sim.parts.shear.process import Fluctuation
from sim.plots.style import (
    BONDS,
    FLUCTUATIONS,
    LINES,
    REFERENCE,
    STYLE,
    legend,
    rows,
    save,
)
from sim.read import engineering
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read
from sim.step.state import MemberNoise, State, Trajectory
from sim.study.accuracy import (
    alternatives,
    changed_part,
    part_table,
    step_values,
    students,
)
from sim.units.errors import BadInput
from sim.units.notation import concise

#: A table to print, and the text below it.
Printed = tuple[list[dict[str, str]], str]
QUANTITIES = (
    "shear_stress",
    "bond_fraction",
    "fluctuation_energy",
    "contact_radius",
    "friction_force",
)
STATISTICS = ("mean", "spread", "skewness", "correlation time")
#: A function that raises an error if the time of a run is spent.
Check = Callable[[], None]
#: A reading of a variable of a run.
Read = Callable[[Scenario, Trajectory], Array]
#: Shape of the errors of a setting.
_SHAPE = len(QUANTITIES), len(STATISTICS)
_READS = tuple(READ[name] for name in QUANTITIES)
_ENERGY, _RADIUS = 2, 3
_SHORT = ("stress", "bonds", "ΔΓ", "radius", "friction")
_WORDS = (
    "the shear stress",
    "the bond fraction",
    "ΔΓ",
    "the radius",
    "the friction force",
)

#: Shares of the budget that are spent on times and on clock steps; the rest is spent on models and grids.
_TIMING, _STEPS = 0.15, 0.3
#: Fewest members that have a standard error, members that are wanted at least, and most of them.
_LEAST, _FEWEST, _MOST = 2, 16, 2**14
#: Most numbers of a sample of one setting: members, times and quantities.
_SAMPLED = 2**22
#: Pieces of a run between which the time is looked at, and factor by which a budget that is named exceeds the estimate.
_PIECES, _MARGIN = 20, 1.3
#: Most numbers that are kept of the finest of several clock steps, and most steps that are timed at once.
_NUMBERS, _PIECE = 2**22, 512
#: Finest clock step over the scene's; share of the tolerance below which an error is small enough.
_FINEST_STEP, _SMALL = 2.0**-12, 0.1
#: Least factor by which the change from quarter to quarter of the clock step falls: 4^p with the order p = 1/2.
_FALL = 2.0
_TOO_LONG = "does not fit into the budget"
#: Shortest time that a piece of work takes [s].
_TICK = 1e-9
#: Errors below this are roundings.
_ROUNDING = 1e-9

#: Parts by the name in the dataset: words, table of the scenario, colour and marker.
_PARTS = {
    "shear": ("shear model", "shear", FLUCTUATIONS, "o"),
    "bonds": ("bond model", "bonds", BONDS, "s"),
    "step": ("clock step", "clock", LINES[3], "^"),
}
#: Unit and meaning of the variables of the dataset, by attribute of ``Setting``.
_DESCRIBED = {
    "part": ("", "part of the scenario that the setting changes"),
    "toml": ("", "lines of the scenario file that choose the setting"),
    "own": ("1", "1 if the scenario has this setting"),
    "time": ("s", "CPU time of the run, of pieces of it"),
    "members": ("1", "members that were compared; 0 if the budget was spent before"),
    "error": ("1", "largest error over the run"),
    "standard_error": ("1", "standard error of the error"),
}
_COLUMNS = ("part", "own", "time", "members", "error", "standard_error")


@dataclass(eq=False)
class Setting:
    """One setting of the scene, with its cost and its error.

    Attributes
    ----------
    label, part, toml : str
        Name; ``"shear"``, ``"bonds"`` or ``"step"``; lines of the scenario file that choose it.
    scenario : Scenario
        The scene at this setting, without sweep and maps.
    own : int
        1 if the scenario has this setting.
    ratio : float
        Clock step over the scene's.
    time : float
        CPU time of the scene's run [s].
    members : int
        Members that were compared; 0 if the budget was spent before.
    error, standard_error : array, shape (quantities, statistics)
        Largest error over the run and its standard error, in units of the largest mean, or for ΔΓ beyond its mean in
        units of its own value; nan if it is not known.
    """

    label: str
    part: str
    scenario: Scenario
    toml: str
    own: int = 0
    ratio: float = 1.0
    time: float = math.nan
    members: int = 0
    error: Array = field(default_factory=lambda: np.full(_SHAPE, np.nan))
    standard_error: Array = field(default_factory=lambda: np.zeros(_SHAPE))

    @property
    def pace(self) -> float:
        """Return the estimated time of a run of one member [s]."""
        return self.time / _members(self.scenario)


@dataclass
class Budget:
    """Time that a study may take, what did not fit into it, and the time that this would need.

    Attributes
    ----------
    now : callable
        The clock [s].
    seconds, end, share : float
        The time to spend [s], the time of ``now`` at its end, and the share of it for the settings in question.
    slower : float
        Largest time of a run over its estimate by a first piece.
    needed : float
        Budget that would answer what was left out [s]; 0 if nothing was.
    left_out : list of str
        Settings that were left out, with the reason.
    """

    now: Callable[[], float]
    seconds: float
    end: float
    share: float = 1.0
    slower: float = 1.0
    needed: float = 0.0
    left_out: list[str] = field(default_factory=list)

    def left(self, until: float = math.inf) -> float:
        """Return the time that is left until a time of ``now``, or until the end [s]."""
        return min(until, self.end) - self.now()

    def check(self, until: float = math.inf) -> None:
        """Raise ``_Spent`` if no time is left until a time of ``now``."""
        if self.left(until) < 0.0:
            raise _Spent

    def needs(self, seconds: float) -> None:
        """Remember that something of this length [s] was left out."""
        self.needed = max(
            self.needed,
            _MARGIN * self.slower * seconds / self.share,
            _MARGIN * self.seconds,
        )


class _Spent(Exception):
    """The time is spent in the middle of a run."""


def converge(
    scenario: Scenario, budget_seconds: float, tolerance: float | None = None
) -> xr.Dataset:
    """Run a scene at every admissible setting, and report the cost and the error of each.

    Parameters
    ----------
    scenario : Scenario
        The scene, without its sweep: at the values that its tables give.
    budget_seconds : float
        Computing time to spend [s]. Settings that do not fit into it are left out and named. The setting of the
        scene is then a row without an error.
    tolerance : float, optional
        Accepted error, by default that of the scene.

    Returns
    -------
    xarray.Dataset
        Along ``row``: the CPU time of the scene's run at each setting, and its largest ``error`` for each ``quantity``
        and ``statistic`` with the ``standard_error``. The attribute ``not_converging`` names results without a limit,
        and ``budget`` [s] is the time that would answer the rest, 0 if nothing was left out.

    Raises
    ------
    BadInput
        If the field is a measured map.

    Notes
    -----
    All recorded times are compared. The error is that of the time at which error and noise together are largest. Its
    bound holds at the time of the largest true error. This time is not random, so the number of times does not matter.
    To show that a difference is no noise takes the quantile of the largest of so many differences instead.

    Errors are in units of the finest setting's value. Those of means are in units of the largest mean over the run,
    those of standard deviations as well, but for ΔΓ in units of its largest standard deviation. Skewness and
    correlation time are compared for ΔΓ alone, in closed form and at a prescribed speed.

    Under a spring or a force, means over the members and the second half of the run are compared. A member that has
    run away counts as zero there.

    A run with the clock step h is off by at most ``k (|d| + t SE(d))``: d is the difference between h and h/4, paired
    over the members, SE(d) its standard error, t Student's quantile (two-sided, 95 %), and ``k = 1/(1 − 4^−p) = 2`` for
    the lowest order, p = 1/2. If the step is quartered more often, the bound is the difference from the finest step
    and ``1/(4^p − 1) = 1`` times the last |d|, or a quarter of the one before if that is larger; standard errors
    likewise.
    A result is shown to converge if the last |d| is within its noise, or smaller than the one before by more than the
    standard error. Differences below ``drive.tolerance`` are not resolved.
    """
    if scenario.fluctuations.measured:
        raise BadInput(
            [
                "shear.field: a map has no simpler model; study fields of its spectrum, shear.spectrum"
            ]
        )
    now = stopwatch()
    began = now()
    budget = Budget(now, budget_seconds, began + 0.5 * budget_seconds)
    chosen_models = {
        "shear": part_table(scenario.fluctuations),
        "bonds": part_table(scenario.population),
    }
    base = scenario.with_values(chosen_models | {"record": {}})
    accepted = tolerance or float(part_table(scenario.shear).get("tolerance", 0.01))
    written = _at_step(base, 1.0)
    settings = [
        row
        for changes in alternatives(base)
        if (row := _admitted(*changes, base, budget))
    ]
    building = now() - began
    for row in [*settings, written]:  # compiles, which is not counted
        with contextlib.suppress(Unresolved):
            recorded(row.scenario, range(1), range(2))
    budget.end = now() + budget_seconds - building
    for row in [*settings, written]:
        row.time = _timed(row.scenario, _TIMING * budget_seconds / (len(settings) + 1))
    parts = [
        list(rows) for _, rows in itertools.groupby(settings, key=lambda row: row.part)
    ]
    judged = list[Setting]()
    for place, rows_of_part in enumerate(parts):
        left = budget.left() - _STEPS * budget_seconds
        budget.share = (1.0 - _TIMING - _STEPS) / len(parts)
        judged += _judged(rows_of_part, now() + left / (len(parts) - place), budget)
    means = [
        row
        for row in judged
        if row.members
        and row.part == "bonds"
        and "sites" not in part_table(row.scenario.bonds)
    ]
    # its mean depends on the noise of the bonds, which other models lack
    driven = scenario.drive.solves_motion
    budget.share = _STEPS
    of_steps, trend = _judged_steps(
        written, written if driven else [written, *means][-1], accepted, budget
    )
    judged += of_steps
    for row in judged if driven else ():
        row.error[:, 1:] = row.standard_error[:, 1:] = np.nan
    dims, variables = ("row", "quantity", "statistic"), dict[str, Any]()
    for name, (unit, text) in _DESCRIBED.items():
        values = np.array([getattr(row, name) for row in judged])
        variables[name] = (
            dims[: values.ndim],
            values,
            {"long_name": text} | ({"units": unit} if unit else {}),
        )
    coordinates = {
        "row": [row.label for row in judged],
        "quantity": [*QUANTITIES],
        "statistic": [*STATISTICS],
    }
    return xr.Dataset(
        variables,
        coordinates,
        {
            "Conventions": "CF-1.11",
            "title": f"speed against error: {scenario.name}",
            "not_converging": trend,
            "sim_version": importlib.metadata.version("sliding-sim"),
            "seed": str(scenario.seed),
            "tolerance": accepted,
            "budget": float(f"{budget.needed:.1e}"),
            "averaged": int(driven),
            "left_out": "\n".join(budget.left_out),
            "swept": ", ".join(key for axis in scenario.sweep for key in axis.keys),
        },
    )


def _members(scenario: Scenario) -> int:
    """Return the members that differ."""
    return scenario.ensemble.members if scenario.is_random else 1


def _admitted(
    part: str, changes: dict[str, Any], base: Scenario, budget: Budget
) -> Setting | None:
    """Return the scene with some keys of a part changed; None, with a reason in ``left_out``, if it refuses them.

    If the time is spent, only the setting of the scene itself is built.
    """
    table_now = part_table(getattr(base, part))
    label = " ".join(map(str, changes.values()))
    is_written = table_now.items() >= changes.items()
    try:
        if budget.left() < 0.0 and not is_written:
            budget.needs(2.0 * budget.seconds)
            raise ValueError(_TOO_LONG)
        changed = base.with_values({part: changed_part(base, part, changes)})
        changed.process  # noqa: B018 - some models are refused only when their modes are made
    except ValueError as fault:
        budget.left_out.append(f"{label}: " + str(fault).partition("\n")[0])
        return None
    toml = "\n".join(f"{key} = {json.dumps(value)}" for key, value in changes.items())
    return Setting(label, part, changed, toml, int(is_written))


def _at_step(scenario: Scenario, ratio: float) -> Setting:
    """Return the scene with its clock step times a power of two and the same records."""
    values = step_values(scenario, ratio)
    changed, step = scenario.with_values({"clock": values}), values["step"]
    text = f'step = "{step:.12g} s"\nrecord = "{values["record"]:.12g} s"'
    label = f"step {engineering(step, 's')}"
    return Setting(label, "step", changed, text, int(ratio == 1.0), ratio)


def _timed(scenario: Scenario, seconds: float) -> float:
    """Return the CPU time of the scene's run [s], by all but the first of the pieces that are run in some seconds."""
    members, last = _members(scenario), scenario.clock.steps
    full = min(together(scenario), members)
    is_quick = seconds_a_step(scenario, full) < 0.25 * seconds
    batch = full if is_quick else min(full, _FEWEST)
    noise, now = MemberNoise.of(scenario.seed, np.arange(batch)), stopwatch()
    state = None
    times, end, step, length = list[tuple[int, float]](), now() + seconds, 0, 1
    while not times or now() < end:
        steps, before = range(step + 1, min(step + length, last) + 1), now()
        state, _ = follow(scenario, noise, state if step else None, steps)
        times.append((len(steps), now() - before))
        step, length = steps[-1] % last, min(2 * length, _PIECE)
    # the first piece has loaded what is computed once
    done, spent = np.sum(times[1:] or times, axis=0).tolist()
    return -(-members // full) * full / batch * last * max(spent, _TICK) / done


def follow(
    scenario: Scenario,
    noise: MemberNoise,
    state: State | None,
    steps: range,
    process: Any = None,
) -> tuple[State, Trajectory]:
    """Return ``Stepper.follow`` of a scenario, by a name at which a test can count the time."""
    stepper = scenario.stepper_with(process) if process else scenario.stepper
    return stepper.follow(noise, state, steps)


def _records(scenario: Scenario) -> range:
    """Return the clock steps at which runs are compared: those of all records, or evenly spaced ones of very many."""
    clock = scenario.clock
    numbers = clock.records * len(QUANTITIES) * (_FEWEST if scenario.is_random else 1)
    every = clock.stride * -(-numbers // _SAMPLED)
    return range(clock.steps % every, clock.steps + 1, every)


def _unlimited() -> None:
    """Check nothing: the time of a run is not limited."""


class Unresolved(RuntimeError):
    """A motion that a setting does not resolve: its missing values are no numbers to compare."""

    exit_code = 1


def recorded(
    scenario: Scenario,
    members: range,
    steps: range,
    reads: Sequence[Read] = _READS,
    check: Check = _unlimited,
    process: Any = None,
) -> Array:
    """Return variables of some members at some clock steps, shape (variables, members, steps).

    Before each piece of the run ``check`` is called, which may raise an error. A shear ``process`` takes the place of
    the scenario's own.
    """
    values, length = list[Array](), max(1, len(steps) // _PIECES)
    for batch in np.array_split(members, -(-len(members) // together(scenario))):
        noise, state = MemberNoise.of(scenario.seed, batch), None
        pieces = list[list[Array]]()
        for begin in range(0, len(steps), length):
            check()
            piece = steps[begin : begin + length]
            state, course = follow(scenario, noise, state, piece, process)
            if scenario.drive.solves_motion:
                unresolved = np.isfinite(cast(Driven, state.drive).unresolved_time)
                if unresolved.any():
                    raise Unresolved(
                        f"with clock.step = {scenario.clock.step:.3g} s some members could not be resolved; "
                        "set drive.viscosity or a shorter clock.step"
                    )
            shape = len(piece), len(batch)
            pieces.append(
                [np.broadcast_to(read(scenario, course), shape).T for read in reads]
            )
        values.append(np.concatenate(pieces, axis=2))
    return np.concatenate(values, axis=1)


def compared(
    scenario: Scenario, members: range, steps: range, check: Check = _unlimited
) -> Array:
    """Return the ``QUANTITIES`` of some members at some clock steps, shape (quantities, members, times).

    Under a spring or a force the only time is the mean over the second half of the steps, because single paths diverge.
    A member that has run away has the value zero.
    """
    if not scenario.drive.solves_motion:
        return recorded(scenario, members, steps, check=check)
    averages, most = list[Array](), _most_at_once(steps)
    for begin in range(0, len(members), most):
        values = recorded(scenario, members[begin : begin + most], steps, check=check)
        late = np.nan_to_num(values[:, :, len(steps) // 2 :])
        averages.append(late.mean(axis=2, keepdims=True))
    return np.concatenate(averages, axis=1)


def _most_at_once(steps: range) -> int:
    """Return the most members whose numbers at some steps are kept."""
    return min(_MOST, max(_LEAST, _SAMPLED // (len(QUANTITIES) * len(steps))))


def _most_members(scenario: Scenario, steps: range) -> int:
    """Return the most members that are compared at some steps; of driven ones only averages are kept."""
    return _MOST if scenario.drive.solves_motion else _most_at_once(steps)


def _over(values: Array, unit: Array) -> Array:
    """Return values in a unit; 0 if the unit is 0."""
    zeros = np.zeros(np.broadcast_shapes(values.shape, unit.shape))
    return np.divide(values, unit, out=zeros, where=unit > 0.0)


def _known(terms: Gammas, power: int) -> Array:
    """Return mean, spread, skewness and correlation time of ΔΓ at amplitude 1, in closed form.

    ΔΓ is a weighted sum of independent gamma numbers, whose n-th cumulant is ``(n − 1)! Σ shape wⁿ``. The rate of a
    mode grows with a ``power`` of its wavenumber.
    """
    mean, variance, third = (np.sum(terms.shape * terms.weight**n) for n in (1, 2, 3))
    lives = np.sum(terms.shape * terms.weight**2 * terms.wavenumber ** -float(power))
    of_spread = _over(np.array([2.0 * third, lives]), variance ** np.array([1.5, 1.0]))
    return np.array([mean + terms.constant, math.sqrt(variance), *of_spread])


def _errors(values: Array, reference: Array, known: Array | None = None) -> Array:
    """Return the differences between two settings at the time of their largest bound, and their standard errors.

    Parameters
    ----------
    values, reference : array, shape (quantities, members, times)
        The ``QUANTITIES``; a single member stands for all.
    known : array, optional
        Relative errors of mean, spread, skewness and correlation time of ΔΓ, which replace the sampled ones. The radius
        is corrected in proportion (control variate), which removes most of its noise.

    Returns
    -------
    array, shape (2, quantities, 4)
        Error and standard error by quantity and statistic, in units of the largest mean, for the
        spread of ΔΓ of its largest spread.
    """
    changed, exact = map(_moments, np.broadcast_arrays(values, reference))
    difference = changed - exact
    if known is not None:
        of_energy, of_radius = exact[_ENERGY, 0, 1:], exact[_RADIUS, 0, 1:]
        along = np.sum(of_radius * of_energy, axis=0)
        slope = _over(along, np.sum(of_energy**2, axis=0))
        slopes = np.stack([slope, np.abs(slope)])[:, np.newaxis]
        wanted = known[:2, np.newaxis, np.newaxis] * exact[_ENERGY]
        difference[_RADIUS] += slopes * (wanted - difference[_ENERGY])
    size, influence = np.abs(difference[:, :, 0]), difference[:, :, 1:]
    count = influence.shape[2]
    deviation = np.sqrt(np.sum(influence**2, axis=2) / (count * max(count - 1, 1)))
    largest = (size + students(count) * deviation).argmax(axis=2, keepdims=True)
    unit = np.repeat(np.abs(exact[:, :1, 0]).max(axis=2), 2, axis=1)
    unit[_ENERGY, 1] = exact[_ENERGY, 1, 0].max() or unit[_ENERGY, 1]
    result = np.full((2, *_SHAPE), np.nan)
    for part, values in zip(result, (size, deviation), strict=True):
        part[:, :2] = _over(np.take_along_axis(values, largest, 2)[..., 0], unit)
    if known is not None:
        result[:, _ENERGY] = np.abs(known), np.zeros(len(STATISTICS))
    return result


def _moments(sample: Array) -> Array:
    """Return mean and spread over the members, each followed by each member's influence on it.

    The shape is (quantities, 2, 1 + members, times).
    """
    mean, spread = (
        np.nan_to_num(of(sample, axis=1, keepdims=True)) for of in (np.mean, np.std)
    )
    spread = np.where(spread > 1e-12 * np.abs(mean), spread, 0.0)
    off = np.where(spread > 0.0, sample - mean, 0.0)
    on_spread = _over(off**2 - spread**2, 2.0 * spread)
    parts = (mean, off), (spread, on_spread)
    return np.stack([np.concatenate(part, axis=1) for part in parts], axis=1)


def _judged(settings: list[Setting], until: float, budget: Budget) -> list[Setting]:
    """Return the settings of one part that fit into the time, with their errors against the finest of them.

    As many members are compared as are estimated to fit into half of the time. A first few of them show the time of a
    run. Without a finer setting, that of the scene has no error, and none is returned but itself.
    """
    (own,) = (row for row in settings if row.own)
    finer = settings[settings.index(own) + 1 :]
    nearest = min(finer, key=lambda row: row.time, default=own)
    order = sorted(
        settings, key=lambda row: (row is not own, row is not nearest, row.time)
    )
    noisy = [row for row in settings if row.scenario.is_random]
    steps = _records([own, *noisy][-1].scenario)
    most, wanted = _most_members(own.scenario, steps), _affordable(noisy, until, budget)
    first = int(np.clip(max(0.25 * wanted, min(wanted, _FEWEST)), _LEAST, most))
    samples, reasons = dict[Setting, Array](), dict[Setting, str]()
    expected = taken = 0.0
    for row in order:
        members = range(first if row in noisy else 1)
        limit, seconds = budget.end if row is own else until, row.pace * len(members)
        reasons[row] = _TOO_LONG
        if budget.slower * seconds > budget.left(limit):
            continue
        before, check = budget.now(), functools.partial(budget.check, limit)
        try:
            samples[row] = compared(row.scenario, members, steps, check)
        except Unresolved as fault:
            if row is own:
                raise
            reasons[row] = str(fault)
        except _Spent:
            pass
        expected += seconds
        taken += budget.now() - before
        budget.slower = max(budget.slower, taken / expected)
    compared_rows = [row for row in settings if row in samples]
    costly = [row for row in compared_rows if row in noisy]
    more = min(_affordable(costly, until, budget), most - first)
    if costly and more >= 1.0:
        check = functools.partial(budget.check, until)
        members = range(first, first + int(more))
        with contextlib.suppress(_Spent, Unresolved):
            rest = [compared(row.scenario, members, steps, check) for row in costly]
            for row, values in zip(costly, rest, strict=True):
                samples[row] = np.concatenate([samples[row], values], axis=1)
    left_out = [row for row in settings if row not in samples]
    budget.left_out += [f"{row.label}: {reasons[row]}" for row in left_out]
    if _TOO_LONG in [reasons[row] for row in left_out]:
        members_of = {row: _FEWEST if row in noisy else 1 for row in settings}
        budget.needs(2.0 * sum(row.pace * members_of[row] for row in settings))
    if own in samples and (compared_rows[-1] is not own or not finer):
        _compare(compared_rows, samples)
        return compared_rows
    return [own]


def _affordable(rows: list[Setting], until: float, budget: Budget) -> float:
    """Return the members of some settings whose runs are estimated to take half of the time that is left."""
    seconds = budget.slower * sum(row.pace for row in rows)
    return 0.5 * budget.left(until) / max(seconds, _TICK)


def _compare(rows: list[Setting], samples: dict[Setting, Array]) -> None:
    """Write the errors of the settings of one part against the last of them."""
    finest, known = rows[-1], None
    part = cast(Any, finest.scenario.fluctuations)
    has_truth = (
        finest.part == "shear"
        and part.is_random
        and not (part.law.relaxing or finest.scenario.drive.solves_motion)
    )
    for row in rows:
        if has_truth:
            known, truth = (
                _known(each.scenario.process.gammas, part.correlation.power)
                for each in (row, finest)
            )
            known = _over(known - truth, truth)
        row.error, row.standard_error = _errors(samples[row], samples[finest], known)
        row.members = max(samples[row].shape[1], samples[finest].shape[1])


class _Replayed:
    """A shear process with the fluctuations of a finer run, of which it has the energy at unit amplitude.

    At the start it draws the same numbers as the finer run.
    """

    def __init__(self, scenario: Scenario, energy: Array) -> None:
        self.process, self.energy = scenario.process, energy
        self.amplitude = scenario.fluctuations.law

    def __getattr__(self, name: str) -> Any:
        return getattr(self.process, name)

    def advance(
        self, state: Any, motions: Motion, bonding: Bonding, noise: Any
    ) -> tuple[Fluctuation, Array]:
        """Return the fluctuations after a block of steps, and ΔΓ at each of them."""
        size = self.amplitude.factor(motions.speed, bonding.strength)
        energy = size**2 * self.energy[motions.step : motions.step + len(motions.time)]
        return Fluctuation(energy[-1], size[-1], np.empty(0)), energy


def _replays(scenario: Scenario) -> bool:
    """True if coarser steps can have the fluctuations of a finer run: the fluctuations do not depend on other parts."""
    part, driven = scenario.fluctuations, scenario.drive.solves_motion
    return part.is_random and not (
        driven or part.law.relaxing or part.law.remembers or part.spectrum.bond_made
    )


def _unit_energy(scenario: Scenario, course: Trajectory) -> Array:
    """Return ΔΓ at amplitude 1 [J/m²]."""
    size = scenario.fluctuations.law.factor(course.speed, course.strength) ** 2
    return _over(course.energy, size)


def _at_steps(
    rows: Sequence[Setting], count: int, check: Check = _unlimited
) -> list[Array]:
    """Return the ``QUANTITIES`` by several clock steps, the finest first; ``check`` as of ``recorded``.

    At a prescribed speed all have the fluctuations that the finest draws. Fluctuations have no error in time. Their
    amplitude and the bonds have, so these are computed at each step.
    """
    (finest, *others), members = (row.scenario for row in rows), range(count)
    if not _replays(finest):
        return [
            compared(scenario, members, _records(scenario), check)
            for scenario in (finest, *others)
        ]
    records, steps = (
        _records(finest),
        range(0, finest.clock.steps + 1, round(rows[1].ratio / rows[0].ratio)),
    )
    values = recorded(finest, members, steps, [*_READS, _unit_energy], check)
    result = [values[:-1, :, records.start // steps.step :: records.step // steps.step]]
    for row in rows[1:]:
        energy = np.ascontiguousarray(
            values[-1, :, :: round(row.ratio / rows[1].ratio)].T
        )
        scenario, process = row.scenario, _Replayed(row.scenario, energy)
        compared_steps = _records(scenario)
        result.append(
            recorded(scenario, members, compared_steps, check=check, process=process)
        )
    return result


def _most_in_series(exact: Scenario) -> int:
    """Return the most members that are compared at several clock steps."""
    if not exact.is_random:
        return 1
    if _replays(exact):
        return max(_LEAST, min(_NUMBERS // exact.clock.steps, together(exact)))
    return _most_members(exact, _records(exact))


def _tried_steps(
    rows: list[Setting], members: int, budget: Budget
) -> list[Array] | None:
    """Return runs at several clock steps; None if the budget is spent before, or if a motion is not resolved."""
    try:
        return _at_steps(rows, members, budget.check)
    except Unresolved as fault:
        budget.left_out.append(str(fault))
    except _Spent:
        pass
    return None


def _judged_steps(
    written: Setting, finest: Setting, accepted: float, budget: Budget
) -> tuple[list[Setting], str]:
    """Return clock steps with their errors, and in words the results that do not converge.

    Steps are quartered until the bound is small, or until the next quarter does not fit into the time. If noise is the
    larger part of the bound, the members are multiplied by four instead. At a prescribed speed the bonds are those of
    the finest model, which any model of small error resembles. If that does not fit, they are those of the scene.
    """
    ratios = [(0.25, 1.0, 4.0), (1.0, 4.0), (0.25, 1.0)]
    if written.scenario.clock.stride % 4:
        ratios = [(0.0625, 0.25, 1.0), (0.25, 1.0)]
    runs = None
    for setting, tried in itertools.product(dict.fromkeys((finest, written)), ratios):
        exact, began = setting.scenario, budget.now()
        cost = budget.slower * setting.pace * sum(1.0 / ratio for ratio in tried)
        most = _most_in_series(exact)
        members = int(np.clip(budget.left() / (6.0 * cost), min(_LEAST, most), most))
        if members * cost <= budget.left():
            rows = [_at_step(exact, ratio) for ratio in tried]
            runs = _tried_steps(rows, members, budget)
        if runs:
            break
    else:
        budget.needs(_FEWEST * 5.25 * written.pace)
        return [written], ""
    following, following_runs = rows, cast(list[Array] | None, runs)
    while following_runs:
        rows, runs, seconds = following, following_runs, budget.now() - began
        count, pairs = runs[0].shape[1], itertools.pairwise(runs)
        changes = np.array([_errors(longer, shorter) for shorter, longer in pairs])
        changes[:, :, :, 2 - exact.drive.solves_motion :] = 0.0
        # a change that is small by chance does not hide those before it, of first order
        falls = 4.0 ** np.arange(len(changes)).reshape(-1, 1, 1, 1)
        rest = np.max(changes / falls, axis=0)
        noise = students(count) * rest[1]
        is_small = np.max(rest[0] + noise) <= _SMALL * accepted
        if is_small or 4.2 * seconds > budget.left():
            break
        began = budget.now()
        if count < most and noise.max() > rest[0].max():
            members = min(4 * count, most)
        elif rows[0].ratio > _FINEST_STEP:
            following = [_at_step(exact, 0.25 * rows[0].ratio), *rows]
        else:
            break
        following_runs = _tried_steps(following, members, budget)
    # the rest of a series that falls by _FALL is its last term here
    for row, run in zip(rows, runs, strict=True):
        row.error, row.standard_error = _errors(run, runs[0]) + rest / (_FALL - 1.0)
        row.members, row.time = count, written.time / row.ratio
    trend = _trend(changes, 2.0 * runs[0].size / count, count, accepted)
    if trend:
        budget.needs(4.2 * seconds)
    return rows[::-1], trend


def _trend(changes: Array, numbers: float, members: int, accepted: float) -> str:
    """Return in words the largest change that exceeds its noise and does not fall with the clock step; "" without one.

    A single change does not show that it falls.

    Noise alone is larger than stated in one study of twenty, though many ``numbers`` are compared.
    """
    last, noise = changes[0]
    shown = (last > students(members, numbers) * noise) & (last > _SMALL * accepted)
    before, noise_before = changes[1] if len(changes) > 1 else (last, noise)
    grown = np.where(
        shown & (before - last <= np.hypot(noise, noise_before)), last, 0.0
    )
    if not grown.any():
        return ""
    what, of = divmod(int(grown.argmax()), grown.shape[1])
    words = f"the {STATISTICS[of]} of {_WORDS[what]} changes by"
    if len(changes) == 1:
        return f"{words} {100.0 * last[what, of]:.2g} %, and the next quarter does not fit into the budget"
    return f"{words} {100.0 * before[what, of]:.2g}, then by {100.0 * last[what, of]:.2g} %"


class Choice(NamedTuple):
    """One setting of each part, with the cost and the error of them together; the clock step is last in ``rows``.

    ``noise`` is Student's quantile (95 %) times the standard error; ``bound`` is the largest sum of error and noise,
    by which combinations are chosen.
    """

    rows: tuple[int, ...]
    time: float
    error: Array
    noise: Array
    bound: float


def choices(dataset: xr.Dataset) -> list[Choice]:
    """Return all combinations of one setting a part, that of the scene first.

    Errors add up, and so does the time that each change adds to a step; clock steps multiply it.
    """
    part, is_written, cost, members, errors, deviations = (
        dataset[name].to_numpy() for name in _COLUMNS
    )
    noises = students(members)[:, np.newaxis, np.newaxis] * deviations
    groups = [
        sorted(np.flatnonzero(part == kind), key=lambda row: -is_written[row])
        for kind in _PARTS
        if kind in part
    ]
    reference, combined = float(cost[groups[-1][0]]), list[Choice]()
    for chosen_rows in itertools.product(*groups):
        place = [int(row) for row in chosen_rows]
        *changed, step = cost[place].tolist()
        total = max(
            sum(changed) - (len(changed) - 1) * reference,
            0.2 * min([reference, *changed]),
        )
        error = np.nan_to_num(errors[place]).sum(axis=0)
        noise = np.sqrt(np.nansum(noises[place] ** 2, axis=0))
        bound = float(np.max(error + noise)) if np.all(members[place] > 0) else math.inf
        combined.append(
            Choice(
                (*place,), float(f"{total * step / reference:.2g}"), error, noise, bound
            )
        )
    return combined


def chosen(tried: list[Choice], tolerance: float) -> tuple[Choice, bool]:
    """Return the cheapest combination that keeps the tolerance, or the most accurate with False.

    Of combinations that take as long, to two digits, the most accurate is used.
    """
    good = [choice for choice in tried if choice.bound <= tolerance * (1.0 + _ROUNDING)]
    best = min(
        good or tried, key=lambda choice: (choice.time if good else 0.0, choice.bound)
    )
    return best, bool(good)


def _worst(error: Array, deviation: Array) -> tuple[str, int, int]:
    """Return the largest of errors (quantities, statistics) in percent, its quantity and its statistic."""
    place = int(np.argmax(np.nan_to_num(error)))
    off, spread = (
        100.0 * float(np.ravel(error)[place]),
        100.0 * float(np.ravel(deviation)[place]),
    )
    text = concise(off, spread) if spread > 0.01 * off else f"{float(f'{off:.2g}'):.4g}"
    return text if max(off, spread) > 100.0 * _ROUNDING else "0", *divmod(
        place, error.shape[1]
    )


def table(dataset: xr.Dataset) -> list[dict[str, str]]:
    """Return a row for each setting, for the terminal."""
    lines = list[dict[str, str]]()
    columns = (dataset[name].to_numpy() for name in ("row", *_COLUMNS))
    for name, part, own, cost, members, *errors in zip(*columns, strict=True):
        duration = engineering(float(f"{cost:.2g}"), "s")
        cells = {
            "changed": str(part),
            "setting": str(name) + " *" * int(own),
            "time": duration,
        }
        for symbol, error, deviation in zip(_SHORT, *errors, strict=True):
            size, _, statistic = _worst(error[np.newaxis], deviation)
            in_words = f" {STATISTICS[statistic]}" if statistic and size != "0" else ""
            cells[f"{symbol}\n(%)"] = size + in_words if members else "–"
        lines.append(cells | {"members": f"{members:,}"})
    return lines


def explanation(dataset: xr.Dataset) -> str:
    """Return the subject of the study and the meaning of the table's columns, in sentences."""
    swept, left_out = (
        dataset.attrs["swept"],
        dataset.attrs["left_out"].replace("\n", "; "),
    )
    compared_values = "mean and spread over the members at all recorded times"
    if dataset.attrs.get("averaged"):
        compared_values = "means over the members and the second half of the run"
    return (
        "Each row changes one setting (* marks the scenario as written). time: CPU time of its run on one core."
        "\n(%): largest difference from a finer setting, its standard error; of ΔΓ beyond its mean in its own units."
        + f"\nThe values of {swept} are those of the tables; choose others by --set."
        * bool(swept)
        + f"\nOmitted: {left_out}." * bool(left_out)
        + _larger_budget(dataset, "answers what is missing")
        + f"\nCompared: {compared_values}."
        + "\nNot compared: peaks, drops of the force, slip events, position, speed, masked share, quantiles."
    )


def _larger_budget(dataset: xr.Dataset, verb: str) -> str:
    """Return a line with the budget that answers what the budget of the study did not; "" if it answered all."""
    needed = float(dataset.attrs.get("budget", 0.0))
    return f"\nA budget of about {engineering(needed, 's')} {verb}." if needed else ""


def recommendation(dataset: xr.Dataset) -> str:
    """Return the cheapest combination that keeps the accepted error, as text and with the lines to write.

    Nothing is recommended if the result does not converge as the clock step decreases.
    """
    if trend := dataset.attrs.get("not_converging"):
        text = f"Convergence is not shown. From quarter to quarter of the clock step {trend}.\nNo setting is"
        return f"{text} recommended. See also sim check.{_larger_budget(dataset, 'tries a finer step')}"
    tolerance, tried = float(dataset.attrs["tolerance"]), choices(dataset)
    if not math.isfinite(tried[0].bound):
        unknown = dataset.isel(
            row=[row for row in tried[0].rows if not dataset["members"].values[row]]
        )
        names = ", ".join(str(name) for name in unknown["row"].values)
        text = f"No setting is recommended, because the budget was spent before the error of {names} was known."
        return text + _larger_budget(dataset, "shows it")
    written, (best, good) = tried[0], chosen(tried, tolerance)
    name = (
        "It"
        if best is written
        else f"“{', '.join(dataset['row'].values[list(best.rows)])}”"
    )
    verdict = (
        "is the fastest combination within"
        if good
        else "has the smallest error; none is shown to be within"
    )
    cost = f"{engineering(best.time, 's')} of CPU time"
    lines = [f"The scenario as written is {_off(written)}."]
    lines.append(f"{name} {verdict} {100.0 * tolerance:.4g} %: {_off(best)}, {cost}.")
    if (factor := (2.0 * float(best.noise.max()) / tolerance) ** 2) > 1.0:
        needed = float(
            f"{factor * dataset['members'].values[list(best.rows)].max():.2g}"
        )
        lines.append(
            f"About {needed:,.0f} members, {factor:.2g} times this budget, reduce the noise to half of that."
        )
    changed = [dataset.isel(row=row) for row in best.rows if row not in written.rows]
    toml = [
        f"\n[{_PARTS[str(row['part'].values)][1]}]\n{row['toml'].values}"
        for row in changed
    ]
    return "\n".join([*lines, *["Write:"] * bool(toml), *toml])


def _off(choice: Choice) -> str:
    """Return the bound of a combination's error, and the part of it that is noise, in words."""
    size, quantity, statistic = _worst(
        choice.error + choice.noise, np.zeros(choice.error.shape)
    )
    share = float(choice.noise[quantity, statistic])
    noise = f", of which {100.0 * share:.2g} % is noise" * (share > _ROUNDING)
    return (
        f"off by at most {size} % ({STATISTICS[statistic]} of {_WORDS[quantity]}{noise})"
        if size != "0"
        else "exact"
    )


def figure(dataset: xr.Dataset) -> Figure:
    """Draw the largest error of each setting against the CPU time of the run, in the width of a column.

    Bars are the noise, at 95 %. Exact settings are drawn at a tenth of the smallest error. A ring marks the scene, a
    star the recommended combination, if there is one.
    """
    tolerance = float(dataset.attrs["tolerance"])
    best, _ = chosen(choices(dataset), tolerance)
    part, is_written, cost, members, *errors = (
        dataset[name].to_numpy() for name in _COLUMNS
    )
    error, deviation = (np.nan_to_num(each).reshape(len(part), -1) for each in errors)
    at = np.arange(len(part)), error.argmax(axis=1)
    off, bars = (
        np.where(members > 0, error[at], np.nan),
        students(members) * deviation[at],
    )
    floor = 0.1 * min([tolerance, *off[off > _ROUNDING]])
    off = np.maximum(off, floor)
    with mpl.rc_context(STYLE):
        picture, (panel,) = rows([3.0])
        for name, (words, _, color, marker) in _PARTS.items():
            here = (part == name) & (members > 0)
            if here.any():
                look: Any = {"c": color, "marker": marker, "ms": 3.6, "lw": 0.6}
                panel.errorbar(cost[here], off[here], bars[here], label=words, **look)
        own = is_written == 1
        ring: Any = {"c": "none", "mec": "black", "ms": 7.5, "label": "as written"}
        panel.plot(cost[own], off[own], "o", **ring)
        if math.isfinite(best.bound) and not dataset.attrs.get("not_converging"):
            star: Any = {"c": "black", "ms": 7.0, "zorder": 5, "label": "recommended"}
            panel.plot(best.time, max(best.bound, floor), "*", **star)
        panel.axhline(tolerance, c=REFERENCE, ls="--", lw=0.8, label="accepted")
        if not np.any(members > 0):  # logarithmic axes need a range
            panel.set_xlim(0.5 * cost.min(), 2.0 * cost.max())
        panel.set(xscale="log", xlabel="CPU time of the run (s)")
        panel.set(yscale="log", ylabel="largest error (bottom: exact)")
        legend(panel)
    return picture


def study(
    scenario: Scenario,
    target: Path,
    replace: bool,
    seconds: float,
    tolerance: float | None,
) -> Printed:
    """Study a scene and save dataset and figure; return the table to print and the text below it."""
    picture = target.with_suffix(".png")
    if picture == target:
        raise BadInput(
            [
                f"{target}: the dataset cannot have the name of its picture; end it in .nc"
            ]
        )
    hdf5.claim(target, replace, files_read(scenario))
    files.claim(picture, replace, files_read(scenario))
    dataset = converge(scenario, seconds, tolerance)
    with files.output(target) as beside:
        lazy.save(dataset, beside)
    save(figure(dataset), picture)
    return table(
        dataset
    ), f"{explanation(dataset)}\n\n{recommendation(dataset)}\n\n{target}\n{picture}"
