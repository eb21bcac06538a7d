"""Systematic errors of a dataset in the unit of its results, and the remarks of ``sim check`` on its scenario."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from sim.read.dataset import ensemble_mean, sweep_dims, word
from sim.units.errors import BadInput
from sim.units.notation import engineering

#: Unit and factor of an error by the last word of its name.
_UNITS = {
    "area": ("points of A/A_JKR", 100.0),
    "friction": ("% of the friction", 100.0),
}
#: Amplitude that depends on the motion: its errors are those of an amplitude of 1.
_OF_MOTION = "slip_rate"
#: Sources of an error by the first word of its name.
_SOURCES = {
    "cell": "the mean ΔΓ of the cell",
    "banded": "banding",
    "step": "the clock step",
    "pull": "the clock step",
}
#: Bound of the error of the load at pull-off.
_PULL_OFF = "pull_off_error"


class SystematicError(NamedTuple):
    """The systematic error of largest size in a sweep: its variable, size and unit, place in words, and its cure."""

    name: str
    value: float
    unit: str
    where: str
    cure: str

    @property
    def matters(self) -> bool:
        """True if the error is a tenth of a point or percent, or of a load."""
        return abs(self.value) >= 0.1 or not self.unit.startswith(("points", "%"))

    def __str__(self) -> str:
        """Return the error in words, with its place and cure."""
        is_relative = self.unit.startswith(("points", "%"))
        size = (
            f"{self.value:+.2g} {self.unit}"
            if is_relative
            else engineering(self.value, self.unit)
        )
        place, cure = (
            f" at {self.where}" if self.where else "",
            f"; cure: {self.cure}" if self.cure else "",
        )
        if self.name == _PULL_OFF:
            size = f"up to {size} to the load at pull-off"
        return f"{_SOURCES[self.name.partition('_')[0]]} adds {size}{place}{cure}"


def systematic_errors(dataset: xr.Dataset) -> list[SystematicError]:
    """Return the systematic errors of recorded areas, frictions and pull-off loads that are not 0, as far as known.

    The cure of an error of the cell leaves about a tenth of it. It is "" if the error is less than 1 % of the JKR area.
    """
    recorded = {"area": "contact_area", "friction": "friction_force"}
    names = [
        f"{source}_error_{of}"
        for of in _UNITS
        for source in ("cell", "banded", "step")
        if recorded.get(of, of) in dataset
    ]
    if {_PULL_OFF, "pull_off_time"} <= {*dataset}:
        # a contact that stays closed has no load at pull-off
        names.append(_PULL_OFF)
        happened = ensemble_mean(dataset["pull_off_time"]).notnull()
        others = {*happened.dims} - {*dataset[_PULL_OFF].dims}
        happened = happened.any([*others])
        dataset = dataset.assign({_PULL_OFF: dataset[_PULL_OFF].where(happened)})
    return [
        _largest(dataset, name)
        for name in names
        if name in dataset and bool((abs(dataset[name]) > 0.0).any())
    ]


def _largest(dataset: xr.Dataset, name: str) -> SystematicError:
    variable = dataset[name]
    size = np.nan_to_num(np.abs(variable.to_numpy()))
    place = dict(
        zip(variable.dims, np.unravel_index(np.argmax(size), size.shape), strict=True)
    )
    known = [at for at in (*sweep_dims(dataset), "error_speed") if at in dataset]
    point, values = (
        dataset[known].isel(place, missing_dims="ignore"),
        float(variable.isel(place)),
    )
    unit, factor = _UNITS.get(name.rpartition("_")[2], (variable.units, 1.0))
    swept = [point[dim] for dim in sweep_dims(dataset)]
    words = [
        f"{at.name} = {engineering(float(at), at.units) if at.dtype.kind == 'f' else at.item()}"
        for at in swept
    ]
    if (
        "error_speed" in point
        and not {"drive_speed", "drive_stage"} & set(sweep_dims(dataset))
        and factor > 1.0
    ):
        words.append(engineering(float(point["error_speed"]), "m/s"))
    amplitude = word(dataset, "shear.amplitude.model", "").isel(
        place, missing_dims="ignore"
    )
    if factor > 1.0 and str(amplitude.item()) == _OF_MOTION:
        words.append("at amplitude 1")
    return SystematicError(
        name, factor * values, unit, ", ".join(words), variable.attrs.get("cure", "")
    )


def remarks(dataset: xr.Dataset) -> list[str]:
    """Return the remarks and the diagnosis that ``sim check`` prints for the scenario of a dataset.

    If the dataset does not hold all of its scenario, as with a measured map, one sentence gives the reason.
    """
    from sim.ensemble import diagnosis, plan  # slow to import
    from sim.ensemble.dataset import scenario_of

    try:
        run = plan.Plan.of(scenario_of(dataset.attrs))
    except BadInput as fault:
        key = fault.problems[0].partition(":")[0]
        return [
            f"the dataset does not hold the whole scenario: the file of {key} is not in it;"
            " `sim check` of the scenario prints its remarks"
        ]
    return [*diagnosis.remarks(run), *diagnosis.diagnosis(run)]
