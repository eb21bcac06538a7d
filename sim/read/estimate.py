"""The statistics of one quantity: its value, and all that stands beside it."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import xarray as xr

from sim.quantities import QUANTITIES
from sim.read.dataset import MEMBERS


class Estimate(NamedTuple):
    """A quantity with its errors, over the sweep and where it has them time, phases or branches.

    A field is None if the sample does not give it, and nan where it is not known.

    Attributes
    ----------
    value : xarray.DataArray
        Mean over the sample, or the number itself; its attributes hold unit and meaning,
        and ``over``, the sample. Of an event it is that of each member at first.
    sem, low, high : xarray.DataArray, optional
        Standard error, and the ends of the 95 % interval. An end alone is a bound.
    bound : xarray.DataArray, optional
        Bound of an error that members do not reduce; its attribute ``source`` is the cause.
    std : xarray.DataArray, optional
        Standard deviation of the sample.
    quantile, quantile_low, quantile_high : xarray.DataArray, optional
        Quantiles and the ends of their 95 % intervals, with the dimension ``quantile``.
    number : xarray.DataArray, optional
        Effective number of independent values.
    reason : xarray.DataArray, optional
        Reason why there is no value, or why it is no mean; "" else.
    plain : xarray.DataArray, optional
        Plain mean over the members, if the value is that at the known mean of ΔΓ.
    bias : xarray.DataArray, optional
        Bound of the bias of such a value, nan where it is the plain mean.
    members : xarray.DataArray, optional
        Number of members that have a value, if members differ and it is known; over time the least of all records.
    """

    value: xr.DataArray
    sem: xr.DataArray | None = None
    low: xr.DataArray | None = None
    high: xr.DataArray | None = None
    bound: xr.DataArray | None = None
    std: xr.DataArray | None = None
    quantile: xr.DataArray | None = None
    quantile_low: xr.DataArray | None = None
    quantile_high: xr.DataArray | None = None
    number: xr.DataArray | None = None
    reason: xr.DataArray | None = None
    plain: xr.DataArray | None = None
    bias: xr.DataArray | None = None
    members: xr.DataArray | None = None

    @property
    def unit(self) -> str:
        """SI unit, "1" for a number."""
        return str(self.value.attrs.get("units", "1"))

    @property
    def source(self) -> str:
        """Cause of the error that members do not reduce, or empty."""
        return "" if self.bound is None else str(self.bound.attrs.get("source", ""))

    def map(self, change: Callable[[xr.DataArray], xr.DataArray]) -> "Estimate":
        """Return it with each known field changed."""
        others = (None if each is None else change(each) for each in self[1:])
        return Estimate(change(self.value), *others)

    def isel(self, at: Mapping[Any, Any]) -> "Estimate":
        """Return it at indices along some dimensions, which not all fields need to have."""
        return self.map(lambda each: each.isel(at, missing_dims="ignore"))

    @property
    def is_missing(self) -> xr.DataArray:
        """True where neither a value nor a bound is known."""
        missing = self.value.isnull()
        for end in (self.low, self.high):
            missing = missing if end is None else missing & end.isnull()
        return missing

    def explained(self, name: str, over: str) -> "Estimate":
        """Return it with its sample, and with the reason of the registry where it is missing without any."""
        value = self.value.assign_attrs(over=over)
        row = QUANTITIES.get(name)
        if row is None or not row.absent or not bool(self.is_missing.any()):
            return self._replace(value=value)
        reason = xr.full_like(value, "", object) if self.reason is None else self.reason
        is_unexplained = self.is_missing & (reason == "")
        reason = xr.where(is_unexplained, row.absent, reason)
        return self._replace(value=value, reason=reason)


def of_every_member(
    values: xr.DataArray, reason: str, share: xr.DataArray | None = None
) -> Estimate:
    """Return values of members; nan at points of the sweep where some members alone have one, with the reason.

    Of recorded statistics over the members the ``share`` that has a value is needed.
    """
    if share is None and MEMBERS in values.dims:
        share = values.notnull().mean(MEMBERS)
    if share is None:
        return Estimate(values)
    of_all, of_some = share == 1.0, share > 0.0
    reasons = xr.where(of_some & ~of_all, reason, "")
    return Estimate(values.where(of_all), reason=reasons)


#: Statistics by the names of their quantities.
Estimates = dict[str, Estimate]


def explained(group: Estimates, over: str) -> Estimates:
    """Return statistics of one sample, each missing value with its reason."""
    return {name: one.explained(name, over) for name, one in group.items()}


def joined(pieces: Sequence[Estimates], dim: str) -> Estimates:
    """Return statistics of pieces one after the other along a dimension; what has none is that of the first."""
    first, *others = pieces
    if not others:
        return first
    how: Any = {"coords": "minimal", "compat": "override", "join": "override"}

    def along(parts: Sequence[Any]) -> Any:
        return xr.concat(parts, dim, **how) if dim in parts[0].dims else parts[0]

    result = {}
    for name, one in first.items():
        columns = zip(*(piece[name] for piece in pieces), strict=True)
        fields = zip(Estimate._fields, columns, strict=True)
        known = {field: along(parts) for field, parts in fields if parts[0] is not None}
        result[name] = one._replace(**known)
    return result
