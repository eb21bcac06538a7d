"""A run that is read: a dataset, and the facts about it, each found once."""

import bisect
import contextlib
from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
import xarray as xr

from sim.read import dataset as datasets
from sim.read.correlation import correlation_time
from sim.read.dataset import MEMBERS
from sim.read.estimate import Estimate, Estimates, explained
from sim.read.events import of_events
from sim.read.late import distribution
from sim.read.observables import closed_observables, restricted
from sim.read.over_speed import loss_speeds
from sim.read.statistics import QUANTILES, averaging, over_members
from sim.units.errors import BadInput

#: Statistics of a quantity by their names.
_FIELDS = {
    "mean": "value",
    "standard error": "sem",
    "low": "low",
    "high": "high",
    "bound": "bound",
    "standard deviation": "std",
    "plain mean": "plain",
    "bias bound": "bias",
}
#: The quantity whose statistics are those of a time.
_MEMORY = "correlation_time"
#: A spread below this share of the mean is of rounding.
_ROUNDING = 1e-12


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
        self.dataset = datasets.plain(datasets.checked(dataset))
        self.lost = lost
        self._late, self._known, self._is_whole = Estimates(), set[str](), False
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
    def members(self) -> int:
        """The number of members if they differ, recorded or not; 1 if they agree."""
        return datasets.number_of_members(self.dataset)

    @cached_property
    def loses_members(self) -> bool:
        """True if members were not recorded, and some of them ended or opened before the end of the run."""
        shares = (
            datasets.recorded_share(self.dataset, event)
            for event in ("runaway_force", "unresolved_time", "first_detachment")
        )
        return any(share is not None and bool((share > 0.0).any()) for share in shares)

    @cached_property
    def drive(self) -> set[str]:
        """The models of the drive in the sweep."""
        words = datasets.word(self.dataset, "drive.model", "")
        return {str(word) for word in np.unique(words.to_numpy().astype(str))}

    @cached_property
    def last(self) -> int:
        """The last record of any trajectory: all of them have stopped after it."""
        end = self.dataset.sizes["t"] - 1
        if "contact_radius" not in self.dataset:
            return end
        radius = datasets.ensemble_mean(self.dataset["contact_radius"])
        if bool(radius.isel(t=end).notnull().any()):
            return end

        def has_stopped(at: int) -> bool:
            return bool(radius.isel(t=at).isnull().all())

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
    def events(self) -> Estimates:
        """Statistics of the events of the run over its members."""
        return of_events(self.dataset, self.sample(late=False))

    @cached_property
    def losses(self) -> Estimates:
        """Speeds at which shares of the area are lost."""
        speeds = loss_speeds(self.dataset, self.lost)
        return explained(speeds, self.sample(late=False))

    def late(self, names: Iterable[str] | None = None) -> Estimates:
        """Return statistics over the second half of a stationary run, of some quantities at least, else of all."""
        missing = {*([_MEMORY] if names is None else names)} - self._known
        self._known |= missing
        if _MEMORY in missing:
            self._late[_MEMORY] = correlation_time(self.dataset)
        missing.discard(_MEMORY)
        if not self._is_whole and (names is None or missing):
            found = distribution(self.dataset, None if names is None else missing)
            self._late |= explained(found, self.sample(late=True))
            self._is_whole = names is None
        return self._late

    def statements(self, names: Iterable[str] | None = None) -> Estimates:
        """Return all numbers of the whole run: events, speeds of losses, and means over the second half.

        Those are of a stationary run, and of the observables ``names``, all by default.
        """
        late = self.late(names) if self.is_stationary else {}
        return self.events | self.losses | late

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
        one, over = self._found(name, late)
        columns = {label: getattr(one, field) for label, field in _FIELDS.items()}
        for ending in ("", " low", " high"):
            levels = getattr(one, f"quantile{ending.replace(' ', '_')}")
            for place, level in enumerate(QUANTILES):
                if levels is not None:
                    at_level = levels.isel(quantile=place, drop=True)
                    columns[f"{100 * level:.0f} %{ending}"] = at_level
        columns |= self._of_each(name, late)
        if one.number is not None:
            columns["number"] = one.number
        known = {label: each for label, each in columns.items() if each is not None}
        arrays = [values.broadcast_like(one.value) for values in known.values()]
        result = xr.concat(
            arrays,
            xr.Variable("statistic", list(known)),
            coords="minimal",
            compat="override",
        )
        about = {"over": one.value.attrs.get("over", over), "source": one.source}
        return result.rename(name).assign_attrs(one.value.attrs | about)

    def _found(self, name: str, late: bool) -> tuple[Estimate, str]:
        """Return the statistics of a quantity, and their sample."""
        if late or name == _MEMORY:
            group = self.late([name])
        else:
            group = over_members(self.dataset, [name])
        if name in group:
            return group[name], self.sample(late)
        for once in (self.events, self.losses):
            if name in once:
                return once[name], self.sample(late=False)
        at_records = over_members(self.dataset.isel(t=[0]))
        known = ", ".join(sorted({*at_records, *self.events, *self.losses}))
        raise BadInput([f"{name}: is not known of this run; known: {known}"])

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
