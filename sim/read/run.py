"""A run that is read: a dataset, and the facts about it, each found once."""

import bisect
import contextlib
from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
import xarray as xr

from sim.read import dataset as datasets
from sim.read.dataset import MEMBERS
from sim.read.observables import closed_observables, restricted
from sim.read.over_speed import loss_speeds
from sim.read.statements import as_means, of_events, sampled
from sim.read.statistics import (
    QUANTILES,
    WIDE,
    averaging,
    correlation_time,
    of_second_half,
    over_members,
)
from sim.units.errors import BadInput

#: Statistics of a quantity, and the endings of the names of their variables.
_KINDS = {
    "mean": "mean",
    "standard error": "sem",
    "low": "low",
    "high": "high",
    "bound": "bound",
    "standard deviation": "std",
}
#: The quantity whose statistics are those of a time.
_MEMORY = "correlation_time"
#: A spread below this share of the mean is of rounding.
_ROUNDING = 1e-12
#: Names of a quantile and of the ends of its interval.
_OF_QUANTILES = ("", " low", " high")


class Run:
    """A run that is read.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of one run or of several that were joined.
    lost : sequence of str or float, optional
        Shares of the JKR area whose loss has a speed, in place of 5 % and 50 % and half
        of all that can be lost: ``["10 %"]``.

    Examples
    --------
    The area that a lens has left at its highest speed, with its standard error:

    >>> import sim
    >>> few = {"ensemble.members": 8}
    >>> run = sim.Run(sim.run(sim.load("scenarios/pdms_lens.toml", few)))
    >>> area = run.statistic("area_ratio").isel(t=-1)
    >>> print(f"{float(area.sel(statistic='mean')):.3f}", area.attrs["over"])
    0.662 8 members
    """

    def __init__(self, dataset: xr.Dataset, lost: Sequence[str | float] = ()) -> None:
        self.dataset = datasets.plain(dataset)
        self.lost = lost
        self._late, self._known, self._is_whole = xr.Dataset(), set[str](), False
        if MEMBERS in self.dataset["contact_modulus"].dims:
            cure = 'xarray.concat(..., "member", data_vars="minimal", coords="minimal", compat="override")'
            raise BadInput(
                [f"numbers of the scenario differ between members; join runs by {cure}"]
            )

    @cached_property
    def sweep(self) -> tuple[str, ...]:
        """The dimensions of the sweep, outermost first."""
        return datasets.sweep_dims(self.dataset)

    @property
    def points(self) -> int:
        """The number of points of the sweep."""
        return int(self.dataset["contact_modulus"].size)

    @cached_property
    def speed_name(self) -> str:
        """The name of the prescribed speed: that of the stage if one pulls."""
        return datasets.speed_name(self.dataset)

    @cached_property
    def speed(self) -> xr.DataArray | None:
        """The prescribed speed of slider or stage [m/s]; None if it was not recorded."""
        if self.speed_name not in self.dataset:
            return None
        return datasets.speed_of(self.dataset).compute()

    @cached_property
    def is_steady(self) -> bool:
        """True if the prescribed speed is constant at each point of the sweep."""
        return datasets.is_steady(self.dataset)

    @cached_property
    def is_held(self) -> bool:
        """True if the mount of the sphere does not change at any point of the sweep."""
        return bool(datasets.stays_held(self.dataset).all())

    @cached_property
    def is_stationary(self) -> bool:
        """True if speed or force and mount are constant, so that means over time exist."""
        return datasets.is_stationary(self.dataset)

    @cached_property
    def has_noise(self) -> bool:
        """True if something is random at some point of the sweep."""
        return bool(datasets.has_noise(self.dataset).any())

    @cached_property
    def has_members(self) -> bool:
        """True if members differ and each was recorded."""
        return MEMBERS in self.dataset.sizes

    @cached_property
    def drive(self) -> set[str]:
        """The models of the drive in the sweep."""
        words = datasets.word(self.dataset, "drive.model", "")
        return {str(word) for word in np.unique(words.to_numpy().astype(str))}

    @cached_property
    def last(self) -> int:
        """The last record of any trajectory: all of them have stopped after it."""
        names = ("contact_radius", "contact_radius_mean")
        radii = [self.dataset[name] for name in names if name in self.dataset]
        end = self.dataset.sizes["t"] - 1
        if not radii or bool(radii[0].isel(t=end).notnull().any()):
            return end

        def has_stopped(at: int) -> bool:
            return bool(radii[0].isel(t=at).isnull().all())

        return bisect.bisect_left(range(1, end), True, key=has_stopped)

    @property
    def lasts(self) -> bool:
        """True if it is stationary and a trajectory lasts to the second half of the run."""
        return self.is_stationary and self.last >= self.dataset.sizes["t"] // 2

    @property
    def has_one_row_each(self) -> bool:
        """True if a point of the sweep has one value, its mean over the second half."""
        return bool(self.sweep) and self.lasts

    @property
    def is_one_ensemble(self) -> bool:
        """True for one stationary run of members that differ."""
        return self.points == 1 and self.has_members and self.lasts

    def sample(self, late: bool) -> str:
        """Return the sample of a mean in words; ``late`` for one over the second half."""
        return averaging(self.dataset, late).removeprefix("mean over the ")

    @cached_property
    def chosen_quantities(self) -> list[str] | None:
        """The quantities of ``record.quantities``; None if all were recorded."""
        with contextlib.suppress(KeyError):
            chosen = datasets.resolved(self.dataset, "record.quantities")
            return None if chosen is None else list(chosen)
        return None

    @cached_property
    def events(self) -> xr.Dataset:
        """Statistics of the events of the run over its members."""
        return sampled(of_events(self.dataset), self.sample(late=False))

    @cached_property
    def losses(self) -> xr.Dataset:
        """Speeds at which shares of the area are lost."""
        speeds = as_means(loss_speeds(self.dataset, self.lost))
        return sampled(speeds, self.sample(late=False))

    def late(self, names: Iterable[str] | None = None) -> xr.Dataset:
        """Return statistics over the second half of a stationary run, of some quantities at least, else of all."""
        missing = {_MEMORY} if names is None else {*names}
        missing -= self._known
        if not self._is_whole and (names is None or missing - {_MEMORY}):
            chosen = None if names is None else missing - {_MEMORY}
            group = of_second_half(self.dataset, chosen)
            self._late.update(sampled(group, self.sample(late=True)))
            self._is_whole = names is None
        if _MEMORY in missing:
            times = correlation_time(self.dataset)
            time, half = times[_MEMORY], WIDE * times[f"{_MEMORY}_sem"]
            columns = {
                "mean": time,
                "sem": times[f"{_MEMORY}_sem"],
                "low": (time - half).assign_attrs(time.attrs),
                "high": (time + half).fillna(times[f"{_MEMORY}_below"]),
                "reason": times[f"{_MEMORY}_reason"],
            }
            columns["high"].attrs |= time.attrs
            self._late.update({f"{_MEMORY}_{kind}": columns[kind] for kind in columns})
        self._known |= missing
        return self._late

    def statements(self, names: Iterable[str] | None = None) -> xr.Dataset:
        """Return all numbers of the whole run; see ``sim.read.statements``."""
        groups = [self.events, self.losses]
        if self.is_stationary:
            groups.append(self.late(names))
        result = xr.merge(groups, compat="no_conflicts", join="outer")
        # of a record that a number was taken from: a statement has no time
        result = result.drop_vars("t", errors="ignore")
        # with their units
        return result.assign_coords({name: self.dataset[name] for name in self.sweep})

    def statistic(self, name: str, late: bool = False) -> xr.DataArray:
        """Return the statistics of one quantity.

        Parameters
        ----------
        name : str
            A recorded quantity, one that follows from recorded ones such as
            ``area_ratio``, or an event such as ``pull_off_load``.
        late : bool
            True for the mean over the second half of a stationary run in place of the
            means over the members at each record.

        Returns
        -------
        xarray.DataArray
            With the dimension ``statistic``: ``mean``, ``standard error``, ``low`` and
            ``high`` (95 % interval of the mean with Student's factor), ``bound`` (of the
            systematic error by clock step or records), ``standard deviation``, the
            quantiles ``5 %``, ``50 %``, ``95 %`` with ``5 % low`` and so on (their 95 %
            intervals), ``skewness`` and ``number`` (of independent values). A statistic
            that is not known is nan. The attribute ``over`` names the sample, ``source``
            the cause of the systematic error.

        Raises
        ------
        BadInput
            If the run has no such quantity, or no mean over time was asked for and the
            run is not stationary.
        """
        if late and not self.is_stationary:
            reason = "speed or mount changes, so that there is no mean over time"
            raise BadInput([f"{name}: {reason}; use late=False"])
        group, over = self._group(name, late)
        columns = {
            kind: group[f"{name}_{ending}"]
            for kind, ending in _KINDS.items()
            if f"{name}_{ending}" in group
        }
        for ending in _OF_QUANTILES:
            variable = f"{name}_quantile{ending.replace(' ', '_')}"
            if variable in group:
                columns |= {
                    f"{100 * level:.0f} %{ending}": group[variable].isel(
                        quantile=k, drop=True
                    )
                    for k, level in enumerate(QUANTILES)
                }
        columns |= self._of_each(name, late)
        if f"{name}_effective_samples" in group:
            columns["number"] = group[f"{name}_effective_samples"]
        mean = columns["mean"]
        arrays = [values.broadcast_like(mean) for values in columns.values()]
        result = xr.concat(
            arrays,
            xr.Variable("statistic", list(columns)),
            coords="minimal",
            compat="override",
        )
        source = group.get(f"{name}_bound", mean).attrs.get("source", "")
        return result.rename(name).assign_attrs(
            mean.attrs | {"over": mean.attrs.get("over", over), "source": source}
        )

    def _group(self, name: str, late: bool) -> tuple[xr.Dataset, str]:
        """Return a group of statistics with those of a quantity, and its sample."""
        if late or name == _MEMORY:
            group = self.late([name])
        else:
            group = over_members(self.dataset, [name])
        if f"{name}_mean" in group:
            return group, self.sample(late)
        for once in (self.events, self.losses):
            if f"{name}_mean" in once:
                return once, self.sample(late=False)
        known = sorted(
            str(key).removesuffix("_mean")
            for each in (
                over_members(self.dataset.isel(t=[0])),
                self.events,
                self.losses,
            )
            for key in each
            if str(key).endswith("_mean")
        )
        raise BadInput([f"{name}: is not known of this run; known: {', '.join(known)}"])

    def _of_each(self, name: str, late: bool) -> dict[str, xr.DataArray]:
        """Return skewness and number of the values of a quantity, of each member."""
        values = closed_observables(restricted(self.dataset, [name]), [name])
        if name not in values or MEMBERS not in values[name].dims:
            return {}
        sample, over = values[name].astype(float), [MEMBERS]
        if late:
            sample = sample.isel(t=slice(sample.sizes["t"] // 2, None))
            over.append("t")
        mean = sample.mean(over)
        off = sample - mean
        variance, third = (off**2).mean(over), (off**3).mean(over)
        return {
            "skewness": third
            / variance.where(variance > (_ROUNDING * mean) ** 2) ** 1.5,
            "number": sample.count(over).astype(float),
        }


def statements(
    dataset: xr.Dataset,
    names: Iterable[str] | None = None,
    lost: Sequence[str | float] = (),
) -> xr.Dataset:
    """Return the statements of a run over the sweep.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    names : iterable of str, optional
        Observables of which means are wanted, all by default.
    lost : sequence of float or str, optional
        Shares of JKR's area whose loss has a speed, see ``Run``.

    Returns
    -------
    xarray.Dataset
        For each statement ``<name>_mean``, its value, with the attribute ``over`` that
        names the sample, and where they are known ``<name>_sem``, ``<name>_low``,
        ``<name>_high``, ``<name>_bound`` and ``<name>_reason``:

        - events of a run (see ``events``), with medians and rates of lifetimes,
        - speeds at which area is lost (see ``loss_speeds``),
        - of a stationary run means over its second half (see ``distribution``).
    """
    return Run(dataset, lost).statements(names)
