"""Speed against error for one scene: ``sim converge``.

Every admissible setting (``sim.study.settings``) is run within a shared budget and set against the
closed form where there is one, else against the best of its own kind. Three errors stand side by
side: what was known before the run, what was measured, and the standard error of the measurement.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sim.engine import march
from sim.ensemble.recorded import VARIABLES
from sim.parts.shear.modal import ModalProcess
from sim.scenario.scenario import Scenario
from sim.study.bond_verdicts import bond_advice, bond_table
from sim.study.bonds import converge_bonds, has_bond_depths
from sim.study.errors import QUANTITIES, Laws, Run, assembled, filled
from sim.study.estimates import Lags, estimates
from sim.study.exact_law import Terms
from sim.study.figure import figure
from sim.study.settings import Setting, settings
from sim.study.stated_times import Moment, stated_times
from sim.study.verdicts import recommendation, table

Array = NDArray[np.float64]
Progress = Callable[[float], None]

_READ = {variable.name: variable.read for variable in VARIABLES}

#: Members advanced together, as in a run, and the numbers that their state may hold.
_BATCH, _STATE_NUMBERS = 64, 2**25

#: Fewest members of a row that is sampled at all; the most values of each quantity that one row keeps.
_FEWEST, _MOST_VALUES = 16, 2**21

#: Share of the budget left to pilots and statistics, and how long a pilot takes [s].
_ASIDE, _PILOT = 0.2, 0.1

#: Share of the budget for the depths of the bonds, where they have some to compare.
_FOR_BONDS = 1.0 / 3.0


def converge(scenario: Scenario, budget_seconds: float, progress: Progress | None = None) -> xr.Dataset:
    """Run a scene at every admissible setting and say how far each is from the truth.

    Parameters
    ----------
    scenario : Scenario
        The scene, without its sweep: at the values that its tables give.
    budget_seconds : float
        Time to sample for, shared equally by the settings; grouping bands and closed forms come on top.
    progress : callable, optional
        Called with the share of the work done since the last call; the shares add up to 1.

    Returns
    -------
    xarray.Dataset
        Dimensions ``row``, ``t`` (the stated times), ``quantity`` and ``statistic``, with ``value``,
        ``reference``, ``error``, ``standard_error``, ``known_error`` in units of a yardstick: the
        reference's own value for mean, standard deviation and correlation time, its mean for
        quantiles, and the skewness of ΔΓ for both skewnesses (1 where ΔΓ has none). Along ``row`` also
        the costs, members and TOML lines, and the measured statistics in SI. Where the bonds have a
        rupture or are counted, also what ``sim.study.bonds.converge_bonds`` gives.

    Notes
    -----
    Closed form: ΔΓ is a sum of independent gamma numbers at any time, and the radius of a contact
    that cannot open a function of it; clock steps are judged against sixteen times finer ones. Where
    bonds are counted or the contact may open, and for the correlation time of the radius, a depth is
    set against the deepest of those whose known and standard errors together are about the least, a
    clock step against the finest and a grid against the finest; the correlation time of the radius is
    known to be as far off as that of ΔΓ, to first order in ΔΓ. A grid is judged by the same cell on a grid
    eight times as fine as the finest. Members are the same in all settings: shared noise counts in the
    standard errors.
    """
    chosen, left_out = settings(scenario)
    base = scenario.with_values({"record": {}})
    truth = Terms.of_cell(base)
    coarsest = round(max([1.0, *(setting.ratio for setting in chosen)]))
    moments = stated_times(base, truth, coarsest)
    runs, order = _distinct(chosen)
    with_bonds = has_bond_depths(base)
    _spend(runs, moments, budget_seconds * (1.0 - _FOR_BONDS * with_bonds), progress)
    laws = Laws(base, truth, moments, chosen)
    numbers = filled(chosen, [runs[k] for k in order], moments, laws)
    found = assembled(scenario, chosen, [runs[k] for k in order], moments, numbers, left_out)
    return joined(found, converge_bonds(scenario, _FOR_BONDS * budget_seconds)) if with_bonds else found


def joined(found: xr.Dataset, of_bonds: xr.Dataset) -> xr.Dataset:
    """Both comparisons in one dataset; they share no name."""
    return found.assign_coords(of_bonds.coords).assign(of_bonds.data_vars).assign_attrs(of_bonds.attrs)


def _distinct(chosen: Sequence[Setting]) -> tuple[list[Run], list[int]]:
    """The scenes to sample, and which one each setting takes."""
    runs: list[Run] = []
    order = []
    for setting in chosen:
        place = next((k for k, run in enumerate(runs) if run.scenario == setting.scenario), len(runs))
        if place == len(runs):
            most = _STATE_NUMBERS // max(2 * setting.scenario.process.pairs, 1)
            runs.append(Run(setting.scenario, setting.ratio, min(_BATCH, max(1, most))))
        order.append(place)
    return runs, order


def _spend(runs: list[Run], moments: list[Moment], budget: float, progress: Progress | None) -> None:
    """Sample every run within the budget."""
    last = max(max(moment.needed) for moment in moments)
    records = len(set().union(*(moment.needed for moment in moments)))
    for run in runs:
        _pilot(run, round(last / run.ratio))
    steps = [round(last / run.ratio) + 1 for run in runs]
    twins = [run.scenario.process.pairs if isinstance(run.scenario.process, ModalProcess) else -1 - k
             for k, run in enumerate(runs)]  # fmt: skip
    caps = [max(_MOST_VALUES // records, _BATCH) if any(run.scenario.varies.values()) else _BATCH for run in runs]
    shares = plan_members(
        [run.cost for run in runs], steps, [run.batch for run in runs], caps, (1.0 - _ASIDE) * budget, twins
    )
    total = sum(run.cost * members * count for run, members, count in zip(runs, shares, steps, strict=True))
    for run, members, count in zip(runs, shares, steps, strict=True):
        if members:
            _sample(run, members, moments, progress, run.cost * count / total)
    if progress is not None and total == 0.0:
        progress(1.0)


def plan_members(
    costs: Sequence[float], steps: Sequence[int], batches: Sequence[int], caps: Sequence[int], budget: float,
    twins: Sequence[int] | None = None,
) -> list[int]:  # fmt: skip
    """How many members each run gets for an equal share of the budget.

    Parameters
    ----------
    costs : sequence of float
        Time per member-step of each run [s].
    steps : sequence of int
        Steps of each run.
    batches, caps : sequence of int
        Members advanced together, and the most that are of use.
    budget : float
        Time of all runs together [s].
    twins : sequence of int, optional
        Runs of the same number draw the same noise and get equally many members.

    Returns
    -------
    list of int
        Whole batches where more than one is affordable; 0 where not even sixteen members are. What a
        run cannot use is left to the others.

    Examples
    --------
    >>> plan_members([1e-6, 1e-3], [100, 100], [64, 64], [10**6, 10**6], 20.0)
    [99968, 64]
    """
    needs = [cost * count for cost, count in zip(costs, steps, strict=True)]
    out: set[int] = set()
    while True:
        open_runs = [k for k in range(len(needs)) if k not in out]
        share, left = 0.0, budget
        for place, k in enumerate(sorted(open_runs, key=lambda k: needs[k] * caps[k])):
            share = left / (len(open_runs) - place)
            left -= min(share, needs[k] * caps[k])
        unaffordable = [k for k in open_runs if needs[k] * min(_FEWEST, caps[k]) > share]
        if not unaffordable:
            break
        out.add(max(unaffordable, key=lambda k: needs[k]))
    members = [0 if k in out else min(int(share / needs[k] + 1e-9), caps[k]) for k in range(len(needs))]
    if twins is not None:
        members = [min(members[j] for j in range(len(needs)) if twins[j] == twins[k]) for k in range(len(needs))]
    return [count - count % batch if count > batch else count for count, batch in zip(members, batches, strict=True)]


def _pilot(run: Run, last: int) -> None:
    """Time per member-step of a batch, measured once everything is compiled and loaded."""
    members = np.arange(run.batch)
    for state in march(run.scenario, members):
        if state.step == min(2, last):
            break
    wall, cpu, done = time.perf_counter(), time.process_time(), 0
    for state in march(run.scenario, members):
        _read(run.scenario, state)
        done += run.batch
        if state.step >= last or time.perf_counter() - wall > _PILOT:
            break
    run.wall, run.cpu = (time.perf_counter() - wall) / done, (time.process_time() - cpu) / done
    run.cost = run.wall


def _read(scenario: Scenario, state: Any) -> list[Array]:
    return [_READ[name](scenario, state) for name in QUANTITIES]


def _sample(run: Run, members: int, moments: list[Moment], progress: Progress | None, worth: float) -> None:
    """March all members of a run, keep what the moments need and estimate from it."""
    needed = sorted(
        step for step in set().union(*(moment.needed for moment in moments)) if not step % max(1, run.ratio)
    )
    columns = {round(step / run.ratio): k for k, step in enumerate(needed)}
    values, last = np.empty((len(QUANTITIES), members, len(needed))), max(columns)
    wall = cpu = 0.0
    for first in range(0, members, run.batch):
        batch = np.arange(first, min(first + run.batch, members))
        began = time.perf_counter(), time.process_time()
        for state in march(run.scenario, batch):
            if state.step in columns:
                for kept, now in zip(values, _read(run.scenario, state), strict=True):
                    kept[batch, columns[state.step]] = now
            if state.step == last:
                break
        wall, cpu = wall + time.perf_counter() - began[0], cpu + time.process_time() - began[1]
        if progress is not None:
            progress(len(batch) * worth)
    run.members, run.wall, run.cpu = members, wall / (members * (last + 1)), cpu / (members * (last + 1))
    places = {step: k for k, step in enumerate(needed)}
    for number, moment in enumerate(moments):
        for stride in {moment.stride(ratio) for ratio in (0.5, 1.0, 2.0, 4.0) if ratio >= run.ratio}:
            ends, lags = _columns(moment, stride, places, run.scenario.clock.step / run.ratio)
            run.found[number, stride] = [estimates(kept, ends, lags) for kept in values]


def _columns(moment: Moment, stride: int, places: dict[int, int], step: float) -> tuple[NDArray[np.intp], Lags | None]:
    """Columns of a moment's values, and the pairs of columns of each lag."""
    ends = [end for end in moment.ends if not moment.pooled or not end % stride]
    shown = np.array([places[end] for end in ends if end in places], np.intp)
    if moment.lags(stride) < 1:
        return shown, None
    earlier, later = [], []
    for lag in range(1, moment.lags(stride) + 1):
        pairs = [(end - lag * stride, end) for end in ends if end - lag * stride in places]
        earlier.append(np.array([places[one] for one, _ in pairs], np.intp))
        later.append(np.array([places[other] for _, other in pairs], np.intp))
    return shown, Lags(earlier, later, stride * step, moment.pooled)


__all__ = ["bond_advice", "bond_table", "converge", "figure", "plan_members", "recommendation", "table"]
