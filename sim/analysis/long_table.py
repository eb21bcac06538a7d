"""Statistics as a long table for other programs, and as a data frame."""

import contextlib
import os
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from sim.analysis.over_speed import loss_speeds
from sim.analysis.scene import answered, is_stationary, speed_name, speed_of, steady_points, sweep_dims
from sim.analysis.stationary import distribution
from sim.analysis.statistics import QUANTILES, averaging, shares, statistics
from sim.analysis.tables import as_means, once
from sim.numerics.files import output

#: Columns of statistics, and the endings of their names in a dataset, with the place of a quantile.
_ENDINGS: dict[str, tuple[str, int]] = {
    "mean": ("mean", 0),
    "error": ("sem", 0),
    "low": ("low", 0),
    "high": ("high", 0),
}
_ENDINGS |= {"sd": ("std", 0), "skewness": ("skewness", 0)}
_ENDINGS |= {
    f"q{100 * level:02.0f}{end}": (f"quantile{end}", place)
    for place, level in enumerate(QUANTILES) for end in ("", "_low", "_high")
}  # fmt: skip
_ENDINGS |= {"effective_samples": ("effective_samples", 0), "correlation_time": ("correlation_time", 0)}
_ENDINGS |= {"correlation_time_error": ("correlation_time_sem", 0)}


def to_csv(dataset: xr.Dataset, path: str | os.PathLike) -> None:
    """Write all statistics as one long table, as ``tidy`` gives them.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    path : path
        The file: a header, then one row for each quantity, sweep value and time. A file is there whole or, in trouble,
        as it was before.
    """
    columns, frames = _frames(dataset)
    units = {str(name): each.attrs.get("units", "1") for name, each in dataset.coords.items()} | {"speed": "m/s"}
    header = [name if units.get(name, "1") == "1" else f"{name} [{units[name]}]" for name in columns]
    with output(Path(path)) as beside, beside.open("w", encoding="utf-8", newline="") as file:
        for names in (header, *[False] * (len(frames) - 1)):
            one = frames.pop(0).reindex(columns=columns)
            one.to_csv(file, header=names, index=False, na_rep="nan", lineterminator="\n")


def tidy(dataset: xr.Dataset) -> pd.DataFrame:
    """All statistics, one row for each quantity, sweep value and time, in SI.

    Returns
    -------
    pandas.DataFrame
        Columns: the swept keys; ``t`` [s], nan where a number is of the whole run or of its second half; the prescribed
        ``speed`` [m/s]; ``quantity``, its ``unit``, and what its ``mean`` is ``over``; ``error`` (standard error),
        ``low`` and ``high`` (95 % interval) of the mean; ``sd``; ``skewness``; quantiles ``q05``, ``q50``, ``q95`` with
        the ends of their intervals; ``effective_samples``, ``correlation_time`` and ``correlation_time_error`` [s].
    """
    columns, frames = _frames(dataset)
    return pd.concat(frames, ignore_index=True)[columns]


def _frames(dataset: xr.Dataset) -> tuple[list[str], list[pd.DataFrame]]:
    """Columns of all statistics, and those of each quantity."""
    members, half = (averaging(dataset, late).removeprefix("mean over the ") or "one run" for late in (False, True))
    late = is_stationary(dataset) and "contact_radius" in dataset
    spread = distribution(dataset) if late else xr.Dataset()  # first, as it keeps trajectories until it ends
    timed = statistics(dataset)
    found = [(timed[[name for name in timed if "t" in timed[name].dims]], members), (once(dataset), members)]
    found.append((as_means(loss_speeds(dataset)), members))
    with contextlib.suppress(ValueError), answered():  # shares are not known of every dataset
        found.append((shares(dataset), members))
    found.append((spread, half))
    frames = [
        _long(dataset, each, str(key), over) for each, over in found for key in each if str(key).endswith("_mean")
    ]
    columns = [*map(str, dataset["contact_modulus"].coords), "t", "speed", "quantity", "unit", "over", *_ENDINGS]
    return [name for name in columns if any(name in frame for frame in frames)], frames


def _long(dataset: xr.Dataset, found: xr.Dataset, key: str, over: str) -> pd.DataFrame:
    """Rows of the statistics of a quantity, the name of whose mean is given."""
    name, dims = key.removesuffix("_mean"), [n for n in (*sweep_dims(dataset), "t") if n in found[key].dims]
    columns = {}
    for column, (ending, place) in _ENDINGS.items():
        if f"{name}_{ending}" in found:  # xarray's get looks for similar names where there is none: half of the time
            values = found[f"{name}_{ending}"]
            columns[column] = values.isel(quantile=place, drop=True) if "quantile" in values.dims else values
    if speed_name(dataset) in dataset:
        speed = speed_of(dataset)
        speed = speed if "t" in dims else speed.isel(t=0, drop=True).where(steady_points(dataset))
        columns |= {"speed": speed} if set(speed.dims) <= set(dims) else {}
    if dims:
        rows = xr.Dataset(columns).to_dataframe(dim_order=dims).reset_index()
    else:
        rows = pd.DataFrame([{column: float(values) for column, values in columns.items()}])
    texts = {"quantity": name, "unit": found[key].attrs.get("units", "1"), "over": over}
    alike = np.zeros(len(rows), int)
    return rows.assign(**{column: pd.Categorical.from_codes(alike, [text]) for column, text in texts.items()})


def frame(dataset: xr.Dataset) -> pd.DataFrame:
    """All statistics at all times and sweep values as a data frame, one row each; ``attrs["units"]`` by column."""
    found = statistics(dataset)
    with contextlib.suppress(ValueError), answered():  # shares are not known of every dataset
        found = found.merge(shares(dataset))
    flat: dict[str, xr.DataArray] = {}
    for key, variable in found.data_vars.items():
        if "quantile" in variable.dims:  # each is a variable of its own
            stem, _, end = str(key).rpartition("_quantile")
            flat |= {
                f"{stem}_q{100 * level:02.0f}{end}": variable.sel(quantile=level, drop=True) for level in QUANTILES
            }
        else:
            flat[str(key)] = variable
    long = xr.Dataset(flat)
    table = long.to_dataframe(dim_order=[*sweep_dims(dataset), "t"]).reset_index()
    table.attrs["units"] = {str(name): each.attrs.get("units", "1") for name, each in long.variables.items()}
    return table
