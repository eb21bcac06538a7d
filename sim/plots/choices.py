"""What can be chosen for a figure: a member, a time, what it is drawn over, units, measured points, axes for it."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr
from matplotlib.axes import Axes

from sim.analysis.scene import MEMBERS
from sim.plots.measured import Measured
from sim.units.quantity import Quantity


class Choices(NamedTuple):
    """Choices for a figure.

    Any kind takes ``member``, one of the ensemble, and ``units`` of axes, such as ``"mm/s"``. Kinds with these
    parameters take ``at``, the time [s] of the record or map that is drawn; ``x``, the variable or swept key that it is
    drawn over; ``absolute``, areas in place of shares; ``data``, measured points in a CSV table or columns in SI by
    name (``{"speed": [1e-3], "contact_area": [4e-8]}``); ``ax``, the matplotlib axes that its first panel is drawn in.
    """

    member: int | None = None
    at: float | str | None = None
    x: str = ""
    absolute: bool = False
    units: tuple[str, ...] = ()
    data: Path | str | Mapping[str, Any] | Measured | None = None
    ax: Axes | None = None

    @property
    def given(self) -> dict[str, Any]:
        """What has been chosen, by name."""
        unsaid = (value is None or value is False or (isinstance(value, str | tuple) and not value) for value in self)
        return {name: value for (name, value), none in zip(self._asdict().items(), unsaid, strict=True) if not none}

    def options(self, kind: str, takes: Collection[str], dataset: xr.Dataset) -> dict[str, Any]:
        """Arguments for what draws a kind of figure.

        Raises
        ------
        ValueError
            For a choice that the kind does not take, or that cannot be read.
        """
        found = {name: value for name, value in self.given.items() if name not in ("member", "units")}
        for name in (name for name in found if name not in takes):
            words = f"it takes: {', '.join(takes)}" if takes else "it takes none but member and units"
            raise ValueError(f'the figure "{kind}" has no choice of {name}; {words}')
        if "at" in found:
            try:
                found["at"] = Quantity("s", "time").read(self.at)
            except ValueError as fault:
                raise ValueError(f"at {self.at}: {fault}") from None
        if self.data is None:
            return found
        return found | {"data": self.data if isinstance(self.data, Measured) else Measured(self.data, dataset)}

    def of_member(self, dataset: xr.Dataset) -> xr.Dataset:
        """The dataset of the member chosen, or of all.

        Raises
        ------
        ValueError
            If there is no such member, or members were not recorded.
        """
        if self.member is None:
            return dataset
        members = int(dataset.attrs["members"])
        if not 0 <= self.member < members:
            raise ValueError(f"there is no member {self.member}; there are members 0 to {members - 1}")
        if MEMBERS not in dataset.dims and any(str(name).endswith("_sem") for name in dataset.data_vars):
            raise ValueError("members were not recorded, only statistics; run again with [record] per_member = true")
        own = dataset.isel({MEMBERS: [self.member]}, missing_dims="ignore")
        if "map_member" in own.dims:
            there = own["map_member"].to_numpy() == self.member
            own = own.isel(map_member=there) if there.any() else own.drop_dims("map_member")
        return own
