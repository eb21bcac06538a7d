"""Statistics of a run for other programs: a data frame of the printed columns, and all quantities in long form."""

import csv
import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from sim.numerics.files import output
from sim.read.correlation import Array
from sim.read.dataset import steady_points
from sim.read.estimate import Estimate
from sim.read.observables import with_slips
from sim.read.run import Run
from sim.read.statistics import QUANTILES, over_members, with_a_value
from sim.read.tables import (
    EVENTS,
    GROUPS,
    LOSSES,
    SLIPS,
    at_records,
    main_columns,
    of_losses,
)
from sim.units.errors import BadInput
from sim.units.notation import chosen_unit

#: Rows of a CSV file that are written at once.
_LINES = 2**15


def frame(run: Run, show: Sequence[str] = ()) -> pd.DataFrame:
    """Return the columns of the printed tables in SI, a row for each point of the sweep and time.

    Parameters
    ----------
    run : Run
        The run.
    show : sequence of str
        Names of ``sim.read.GROUPS``, whose columns are added.

    Returns
    -------
    pandas.DataFrame
        The swept keys; ``t`` [s], unless each point has one row, the mean over the second
        half of the run; and the columns of ``sim stats``, each with ``<name>_error`` (the
        standard error), ``<name>_bound`` (of the error that members do not reduce) and
        ``<name>_reason`` (the reason if a value is missing or no mean), if there are any.
        A reason that columns over time share stands beside the first of them. A number of
        the whole run is the same in all rows of its point. ``attrs["units"]`` holds the
        units by column.

    Raises
    ------
    BadInput
        If there is no such group.
    """
    if unknown := {*show} - GROUPS.keys():
        raise BadInput(
            [f"{min(unknown)}: is no group of columns; there are: {', '.join(GROUPS)}"]
        )
    names = [column.name for column in main_columns(run)]
    if {"losses", "all"} & {*show}:
        names += [column.name for column in LOSSES]
    each = (
        run.late(names)
        if run.has_one_row_each
        else at_records(with_slips(run.dataset), names)
    )
    once = [column.name for column in EVENTS]
    if {"slips", "all"} & {*show}:
        once += [column.name for column in SLIPS]
    losses = [column.name for column in of_losses(run.losses)]
    variables: dict[str, xr.DataArray] = {}
    for name in (name for name in names if name in each):
        told = [variables[key] for key in variables if key.endswith("_reason")]
        variables |= {
            key: values
            for key, values in _columns_of(name, each[name]).items()
            if not any(values.equals(reason) for reason in told)
        }
    for group, wanted in ((run.events, once), (run.losses, losses)):
        for name in (name for name in wanted if name in group):
            variables |= _columns_of(name, group[name])
    coords = {name: run.dataset[name] for name in run.sweep}
    if not run.has_one_row_each:
        coords["t"] = run.dataset["t"]
    flat = (
        xr.Dataset(variables)
        .drop_vars("quantile", errors="ignore")
        .assign_coords(coords)
    )
    flat = flat.drop_vars([name for name in flat.coords if name not in flat.dims])
    dims = [str(name) for name in (*run.sweep, "branch", "t") if name in flat.dims]
    table = flat.expand_dims("row").to_dataframe(dim_order=["row", *dims])
    table = table.reset_index().drop(columns="row")
    table.attrs["units"] = {
        str(name): variable.attrs.get("units", "1")
        for name, variable in flat.variables.items()
    }
    return table


def _columns_of(name: str, one: Estimate) -> dict[str, xr.DataArray]:
    """Return a value and what stands beside it, as far as it is known."""
    has_reason = one.reason is not None and bool((one.reason != "").any())
    if not bool(one.value.notnull().any()) and not has_reason:
        return {}
    result = {name: one.value}
    others = {"error": one.sem, "bound": one.bound, "bias": one.bias}
    if one.plain is not None and bool((one.plain != one.value).any()):
        result[f"{name}_plain"] = one.plain
    for ending, values in others.items():
        if values is not None and bool((values > 0.0).any()):
            values = values.drop_attrs(deep=False).assign_attrs(units=one.unit)
            result[f"{name}_{ending}"] = values
    if one.reason is not None and has_reason:
        result[f"{name}_reason"] = one.reason.drop_attrs(deep=False)
    return result


def to_csv(run: Run, path: str | os.PathLike[str], show: Sequence[str] = ()) -> None:
    """Write the ``frame`` of a run, a column ``name [unit]`` for each of its own.

    Units are those of ``in_units``, else SI. A file is there whole or, in trouble, as it
    was before.
    """
    rows = frame(run, show)
    header, columns = [], []
    for name in rows:
        unit = rows.attrs["units"].get(name, "1")
        factor, shown = chosen_unit(unit) or (1.0, unit)
        header.append(_with_unit(str(name), shown))
        values = rows[name].to_numpy()
        columns.append(values if factor == 1.0 else factor * values)
    _write(Path(path), header, [columns])


def to_long_csv(run: Run, path: str | os.PathLike[str]) -> None:
    """Write all quantities in long form, as ``long`` gives them; files as of ``to_csv``."""
    names, parts = _long(run)
    units = {
        str(name): variable.attrs.get("units", "1")
        for name, variable in run.dataset.coords.items()
    }
    header = [
        _with_unit(name, (units | {"speed": "m/s"}).get(name, "1")) for name in names
    ]
    missing = np.array(np.nan)
    columns = [[part.get(name, missing).ravel() for name in names] for part in parts]
    _write(Path(path), header, columns)


def _write(path: Path, header: Sequence[str], parts: Iterable[Sequence[Array]]) -> None:
    """Write parts of a table, each given by columns; a column of one value is that in all rows."""
    with (
        output(path) as beside,
        beside.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(",".join(_quoted(header)) + "\n")
        for columns in parts:
            count = max(map(len, columns), default=0)
            # because the texts of all rows together take much memory
            for start in range(0, count, _LINES):
                rows = slice(start, min(start + _LINES, count))
                fields = (
                    _texts(values[rows])
                    if len(values) == count
                    else _texts(values) * (rows.stop - start)
                    for values in columns
                )
                file.writelines(
                    f"{line}\n" for line in map(",".join, zip(*fields, strict=True))
                )


def _texts(values: Array) -> list[str]:
    """Return a column as fields of CSV, each different value written once."""
    # 0.0 and -0.0 differ
    bits = values.view(np.int64) if values.dtype == np.float64 else values
    places, alike = pd.factorize(bits, use_na_sentinel=False)
    texts = (
        _quoted(alike)
        if bits is values
        else list(map(repr, alike.view(np.float64).tolist()))
    )
    return list(map(texts.__getitem__, places.tolist()))


def _quoted(values: Iterable[Any]) -> list[str]:
    """Return values as fields of CSV, with quotation marks if they are needed."""
    fields: list[str] = []
    for value in values:
        line = io.StringIO()
        csv.writer(line, lineterminator="").writerow(
            ["nan" if pd.isna(value) else value, ""]
        )
        fields.append(line.getvalue()[:-1])
    return fields


def _with_unit(name: str, unit: str) -> str:
    return name if unit in ("1", "") else f"{name} [{unit}]"


#: Columns that are texts, of which a quantity has one.
_TEXTS = "quantity", "unit", "over", "source"
#: Columns of statistics in long form, and the fields of an ``Estimate``.
_FIELDS = {
    "mean": "value",
    "error": "sem",
    "low": "low",
    "high": "high",
    "bound": "bound",
    "sd": "std",
    "plain_mean": "plain",
    "bias_bound": "bias",
}
#: Columns of quantiles: field, place, and name.
_QUANTILES = [
    (f"quantile{end}", place, f"q{100 * level:02.0f}{end}")
    for place, level in enumerate(QUANTILES)
    for end in ("", "_low", "_high")
]
_COLUMNS = [*_FIELDS, *(name for _, _, name in _QUANTILES), "effective_samples"]


def long(run: Run) -> pd.DataFrame:
    """Return all quantities, one row for each quantity, sweep value and time, in SI.

    Returns
    -------
    pandas.DataFrame
        Columns: the swept keys; ``t`` [s], nan if a number is of the whole run or of its
        second half; the prescribed ``speed`` [m/s]; ``quantity``, its ``unit``, and what
        its ``mean`` is ``over``; ``error`` (standard error), ``low`` and ``high`` (95 %
        interval) of the mean; ``bound`` of the error that members do not reduce, by its
        ``source``; ``sd``; quantiles ``q05``, ``q50``, ``q95`` with the ends of their
        intervals; ``effective_samples``.
    """
    names, parts = _long(run)
    wholes = (
        {n: np.broadcast_to(v, part["mean"].shape).ravel() for n, v in part.items()}
        for part in parts
    )
    return pd.concat(map(pd.DataFrame, wholes), ignore_index=True)[names]


def _long(run: Run) -> tuple[list[str], list[dict[str, Array]]]:
    """Return the columns of ``long``, and those of each quantity; a text is shared by all rows."""
    dataset = run.dataset
    places = [*map(str, dataset["contact_modulus"].coords), "branch", "phase", "t"]
    parts = []
    at_times = over_members(dataset)
    for group, sample in ((at_times, run.sample(late=False)), (run.statements(), "")):
        for name, one in group.items():
            value = one.value.variable
            known = {
                at: dataset[at].variable if at in dataset else one.value[at].variable
                for at in places
                if at in one.value.coords
            }
            known |= {
                str(at): place.variable
                for at, place in dataset["contact_modulus"].coords.items()
                if {*place.dims} <= {*value.dims}
            }
            columns = known | _speed_beside(run, value) | _statistics_of(one)
            dims = (*run.sweep, *places[-3:])
            sizes = {dim: value.sizes[dim] for dim in dims if dim in value.dims}
            texts = {
                "quantity": name,
                "unit": one.unit,
                "over": one.value.attrs.get("over", sample) or "one run",
                "source": one.source,
            }
            part = {column: np.array(text, object) for column, text in texts.items()}
            if one.members is not None and {*one.members.dims} <= sizes.keys():
                counts = one.members.variable.set_dims(sizes).to_numpy()
                part["over"] = _samples_of(texts["over"], run.members, counts)
            for column, values in columns.items():
                if {*values.dims} <= sizes.keys():
                    # an integer as a number that may be missing
                    kind = float if values.dtype.kind == "i" else values.dtype
                    part[column] = values.astype(kind).set_dims(sizes).to_numpy()
            parts.append(part)
    names = (*places, "speed", *_TEXTS, *_COLUMNS)
    return [name for name in names if any(name in part for part in parts)], parts


def _samples_of(sample: str, members: int, counts: Array) -> Array:
    """Return a sample in words for each number of members that have a value, of all ``members``."""
    texts = np.full(counts.shape, sample, object)
    for count in np.unique(counts[(counts > 0) & (counts < members)]):
        texts[counts == count] = with_a_value(sample, members, int(count))
    return texts


def _statistics_of(one: Estimate) -> dict[str, xr.Variable]:
    """Return the columns of the statistics of a quantity."""
    columns = {name: getattr(one, field) for name, field in _FIELDS.items()}
    columns["effective_samples"] = one.number
    for field, place, name in _QUANTILES:
        levels = getattr(one, field)
        columns[name] = None if levels is None else levels.isel(quantile=place)
    return {name: v.variable for name, v in columns.items() if v is not None}


def _speed_beside(run: Run, mean: xr.Variable) -> dict[str, xr.Variable]:
    """Return the prescribed speed at the times of a mean, or that of a whole steady run."""
    if run.speed is None:
        return {}
    if "t" in mean.dims:
        return {"speed": run.speed.variable}
    first = run.speed.isel(t=0, drop=True)
    return {"speed": first.where(steady_points(run.dataset)).variable}
