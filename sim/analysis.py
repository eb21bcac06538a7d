"""Statistics of a dataset: over its members, at each time and sweep value, and what they say about the area.

Everything is read from the file; nothing of the simulation is needed. *Observables* are variables
per member and time, some recorded, some derived from recorded ones (the share of the area lost to
broken bonds, whether adhesion is masked); ``summary`` turns them into statistics over the members.
"""

import contextlib
import csv
import math
import os
import re
import warnings
from typing import NamedTuple

import numpy as np
import scipy.fft
import xarray as xr

from sim.laws import jkr

QUANTILES = (0.05, 0.5, 0.95)

#: How many correlation times the autocorrelation is summed over: what is cut off is e^-6 of it.
_WINDOW = 6.0

_KEPT = ("mean", "std", "sem")
_MEMBERS = "realization"


def sweep_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Names of the sweep's dimensions, outermost first."""
    return tuple(str(name) for name in dataset["contact_modulus"].dims)


def is_steady(dataset: xr.Dataset) -> bool:
    """Whether the speed stays what it was at the start, at every point of the sweep."""
    speed = dataset["speed"]
    return bool((speed == speed.isel(t=0)).all())


def setting(dataset: xr.Dataset, key: str) -> xr.DataArray:
    """A number of the scenario by its dotted key, with the sweep's dimensions where it is swept.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it: a number that is the same everywhere is the variable
        ``contact_load``, a swept one the coordinate ``load`` (or ``contact_load``).
    key : str
        Such as ``"contact.load"``.

    Raises
    ------
    KeyError
        If the dataset does not hold it as a number.
    """
    words = key.split(".")
    names = ["_".join(words[-count:]) for count in range(len(words), 0, -1)]
    if names[0] in dataset.variables:
        return dataset[names[0]]
    for name in names[1:]:
        if name in dataset.coords and name != "t" and dataset[name].dtype.kind == "f":
            return dataset[name]
    raise KeyError(f"the dataset does not hold {key} as a number")


def _equilibrium(dataset: xr.Dataset, work: xr.DataArray) -> xr.DataArray:
    """Stable JKR radius for a work of adhesion under the dataset's control [m]; 0 without equilibrium."""
    laws = {"contact.load": jkr.radius_at_load, "contact.indentation": jkr.radius_at_indentation}
    for key, law in laws.items():
        try:
            control = setting(dataset, key)
        except KeyError:
            continue
        radius = xr.apply_ufunc(law, control, work, setting(dataset, "sphere.radius"), dataset["contact_modulus"])
        return radius.fillna(0.0)
    raise KeyError("the dataset holds neither contact.load nor contact.indentation as a number")


def bond_work(dataset: xr.Dataset) -> xr.DataArray:
    """Work of adhesion that the bonds left would give without fluctuations: Δγ(fraction) [J/m^2].

    ``work (1 - share + share * fraction)``, per member where the bonds differ between members, and
    of the mean fraction where only that was recorded.
    """
    share = setting(dataset, "adhesion.bond_share")
    fraction = dataset["bond_fraction" if "bond_fraction" in dataset else "bond_fraction_mean"]
    left = setting(dataset, "adhesion.work") * (1.0 - share + share * fraction)
    return _ordered(left).assign_attrs(units="J/m^2", symbol="Δγ", long_name="work of adhesion of the bonds left")


def _ordered(variable: xr.DataArray) -> xr.DataArray:
    """Members and time last."""
    return variable.transpose(..., *(name for name in (_MEMBERS, "t") if name in variable.dims))


def share_observables(dataset: xr.Dataset) -> xr.Dataset:
    """The shares of JKR's area that each mechanism takes, per member and time.

    Raises
    ------
    ValueError
        If the bonds differ between members but only their mean was recorded, or the dataset does
        not hold the numbers that the JKR radius needs.
    """
    if "bond_fraction" not in dataset:
        raise ValueError("shares need the bonds of each member; record them: [record] per_member = true")
    suffix = "" if "contact_area" in dataset else "_mean"
    area, full = dataset[f"contact_area{suffix}"].astype(float), _full_area(dataset)
    try:
        bonds_only = np.pi * _equilibrium(dataset, bond_work(dataset)) ** 2
    except KeyError as missing:
        raise ValueError(f"{missing.args[0]}; sweep its number, not its whole table") from None
    # pulled off for good: where bonds alone had opened the contact, its staying open is their doing
    opened = xr.apply_ufunc(
        np.logical_or.accumulate, bonds_only == 0.0,
        input_core_dims=[["t"]], output_core_dims=[["t"]], kwargs={"axis": -1},
    )  # fmt: skip
    bonds_only = bonds_only.where(~(opened & (area == 0.0)), 0.0)
    words = "share of JKR's area lost to"
    found = {
        "lost_to_bonds": _pure((full - bonds_only) / full, f"{words} broken bonds, which are charged first"),
        f"lost_to_fluctuations{suffix}": _pure((bonds_only - area) / full, f"{words} fluctuations, after the bonds"),
    }
    if suffix:  # the bonds are the same for all members, so the spread is the area's
        for kind in ("std", "sem"):
            found[f"lost_to_fluctuations_{kind}"] = _pure(dataset[f"contact_area_{kind}"] / full, "")
    return xr.Dataset(found)


def _full_area(dataset: xr.Dataset) -> xr.DataArray:
    """JKR's area at the full work of adhesion [m^2]; nan where there is no contact at rest."""
    area = np.pi * dataset["radius_at_rest"] ** 2
    return area.where(area > 0.0)


def _pure(values: xr.DataArray, text: str, symbol: str = "") -> xr.DataArray:
    """A pure number, described."""
    return _ordered(values).assign_attrs(units="1", long_name=text, symbol=symbol)


def observables(dataset: xr.Dataset) -> xr.Dataset:
    """Every recorded trajectory, per member where members differ, and what follows from them.

    ``area_ratio`` is A/A_JKR; ``fraction_detached`` is 1 where the contact is open, ``fraction_masked``
    is 1 where it is closed though no work of adhesion is left (Hertz's contact): their ensemble means
    are the fractions.
    """
    found = dataset.drop_vars([n for n, v in dataset.data_vars.items() if "t" not in v.dims])
    for suffix in ("", *(f"_{kind}" for kind in _KEPT)):
        if f"contact_area{suffix}" in found:
            ratio = found[f"contact_area{suffix}"].astype(float) / _full_area(dataset)
            found[f"area_ratio{suffix}"] = _pure(ratio, "contact area over JKR's", "A/A_JKR")
        if f"in_contact{suffix}" in found:
            closed = found[f"in_contact{suffix}"].astype(float)
            opened = closed if suffix in ("_std", "_sem") else 1.0 - closed
            found[f"fraction_detached{suffix}"] = _pure(opened, "open contacts")
    if "work_of_adhesion" in dataset and "in_contact" in dataset:
        masked = (dataset["work_of_adhesion"] <= 0.0) & (dataset["in_contact"] == 1)
        found["fraction_masked"] = _pure(masked.astype(float), "closed contacts without work of adhesion")
    return found.drop_vars([n for n in found if str(n).startswith("in_contact")])


def settled(trajectories: xr.Dataset) -> xr.Dataset:
    """Observables averaged over the second half of the run, one record long.

    Each member is averaged over time first, so that a standard error over members holds whatever
    the correlation in time. Where only statistics were recorded, their mean over time is taken:
    for a standard error an upper bound.
    """
    late = trajectories.isel(t=slice(trajectories.sizes["t"] // 2, None))
    averaged = late.mean("t", keep_attrs=True).expand_dims(t=late["t"][-1:], axis=-1)
    return averaged.map(_ordered, keep_attrs=True)


def summary(trajectories: xr.Dataset) -> xr.Dataset:
    """Mean, standard deviation, standard error and quantiles over the members.

    Parameters
    ----------
    trajectories : xarray.Dataset
        Observables. One without the dimension ``realization`` is the same for all members: its
        spread is 0. Variables that are statistics already (``…_mean``, ``…_std``, ``…_sem``) pass.

    Returns
    -------
    xarray.Dataset
        For each observable ``…_mean``, ``…_std``, ``…_sem`` and ``…_quantile`` (with the dimension
        ``quantile``: 5, 50, 95 %). The standard error and deviation of a single member are nan. A
        member that has no value (the indentation of an open contact) is left out.
    """
    found: dict[str, xr.DataArray] = {}
    for key, variable in trajectories.data_vars.items():
        name = str(key)
        if name.rpartition("_")[2] in _KEPT:
            found[name] = variable
            continue
        for kind, values in _statistics_of(variable.astype(float)).items():
            text = {"mean": "ensemble mean", "std": "standard deviation", "sem": "standard error of the ensemble mean"}
            found[f"{name}_{kind}"] = values.assign_attrs(
                variable.attrs, long_name=f"{text.get(kind, 'quantiles')} of {variable.attrs.get('long_name', name)}"
            )
    return xr.Dataset(found)


def _statistics_of(variable: xr.DataArray) -> dict[str, xr.DataArray]:
    if _MEMBERS not in variable.dims:
        none = xr.zeros_like(variable).where(variable.notnull())
        levels = variable.expand_dims(quantile=list(QUANTILES))
        return {"mean": variable, "std": none, "sem": none, "quantile": levels}
    count = variable.notnull().sum(_MEMBERS)
    mean = variable.mean(_MEMBERS)
    free = (count - 1.0).where(count > 1)
    deviation = (((variable - mean) ** 2).sum(_MEMBERS) / free) ** 0.5
    gaps = bool((count < variable.sizes[_MEMBERS]).any())
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)  # nan is the answer there
        levels = variable.quantile(list(QUANTILES), _MEMBERS, skipna=gaps)
    return {"mean": mean, "std": deviation, "sem": deviation / count.where(count > 0) ** 0.5, "quantile": levels}


def statistics(dataset: xr.Dataset) -> xr.Dataset:
    """Statistics over the members of everything recorded, at each sweep value and time.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member or with statistics only.

    Returns
    -------
    xarray.Dataset
        ``…_mean``, ``…_std``, ``…_sem`` and ``…_quantile`` of every trajectory (see ``summary``), the
        same of ``area_ratio`` (A/A_JKR), ``fraction_detached`` and ``fraction_masked`` (the latter is
        not known where only statistics were recorded), and ``correlation_time`` with its standard
        error.
    """
    return summary(observables(dataset)).merge(correlation_time(dataset))


def shares(dataset: xr.Dataset) -> xr.Dataset:
    """Which share of the lost contact area comes from broken bonds and which from shear fluctuations.

    Returns
    -------
    xarray.Dataset
        Statistics (``…_mean``, ``…_std``, ``…_sem``, ``…_quantile``) over the members of
        ``lost_to_bonds`` and ``lost_to_fluctuations``; and, at each sweep value, ``radius_jkr``,
        ``radius_hertz`` [m] and ``area_ratio_hertz``. nan where there is no contact at rest.

    Raises
    ------
    ValueError
        See ``share_observables``.

    Notes
    -----
    With A_JKR the area at the full work of adhesion and A_bonds the area at what the bonds left
    would give, ``lost_to_bonds = (A_JKR - A_bonds)/A_JKR`` and ``lost_to_fluctuations = (A_bonds -
    A)/A_JKR``: in each member they and ``area_ratio`` add up to one. The order is a choice: the area is
    not linear in the work, so fluctuations that are taken off after the bonds weigh more.
    """
    found = summary(share_observables(dataset))
    rest, hertz = dataset["radius_at_rest"], dataset["radius_without_adhesion"]
    found["radius_jkr"], found["radius_hertz"] = rest, hertz
    ratio = (hertz / rest.where(rest > 0.0)) ** 2
    found["area_ratio_hertz"] = ratio.assign_attrs(units="1", long_name="Hertz's contact area over JKR's", symbol="")
    return found


class IntegralTime(NamedTuple):
    """An integral correlation time and its standard error [s]."""

    time: float
    sem: float


def integral_time(values: np.ndarray, step: float) -> IntegralTime:
    """Integral correlation time of stationary trajectories: the integral of the autocorrelation.

    Parameters
    ----------
    values : array, shape (members, records)
        Independent members of one process.
    step : float
        Time between records [s].

    Returns
    -------
    IntegralTime
        In seconds. nan where nothing fluctuates, where neighbouring records are correlated by less
        than 1/e (record more often), and where the run is shorter than the window (run longer, or
        with more members).

    Notes
    -----
    The autocovariance is averaged over members and times, of the deviations from the ensemble mean
    at each time (unbiased; for a single member from its own mean in time). Its integral
    ``T(W) = step (1/2 + sum of rho_k, k = 1 ... W)`` is cut at the smallest W >= 6 T(W)/step
    (A. Sokal, Monte Carlo Methods in Statistical Mechanics, 1997), which leaves out e^-6 of an
    exponential memory; the trapezoidal sum adds (step/T)^2/12. The standard error ``T sqrt(2 (2W +
    1)/n)``, n the number of free values, is Madras and Sokal's for a Gaussian process (J. Stat.
    Phys. 50 (1988) 109).

    Examples
    --------
    Values that forget by half from one record to the next:

    >>> rng = np.random.default_rng(5)
    >>> x = np.zeros((64, 4000))
    >>> for k in range(1, 4000):
    ...     x[:, k] = 0.5 * x[:, k - 1] + rng.normal(size=64)
    >>> time, sem = integral_time(x, step=1.0)
    >>> print(f"{0.5 + 0.5 / (1 - 0.5):.2f} {abs(time - 1.5) < 5 * sem} {sem < 0.03}")
    1.50 True True
    """
    members, records = values.shape
    nothing = IntegralTime(math.nan, math.nan)
    if records < 2 or not np.all(np.isfinite(values)):
        return nothing
    free = max(members - 1, 1)
    deviation = values - (values.mean(axis=0) if members > 1 else values.mean())
    size = scipy.fft.next_fast_len(2 * records, real=True)
    power = np.abs(scipy.fft.rfft(deviation, size, axis=1)) ** 2
    covariance = scipy.fft.irfft(power.sum(axis=0), size)[:records] / (free * np.arange(records, 0, -1))
    if not covariance[0] > (1e-10 * np.max(np.abs(values))) ** 2:
        return nothing
    correlation = covariance / covariance[0]
    sums = 0.5 + np.concatenate([[0.0], np.cumsum(correlation[1:])])
    windows = np.flatnonzero(np.arange(records) >= _WINDOW * sums)
    if correlation[1] < math.exp(-1.0) or len(windows) == 0:
        return nothing
    window = int(windows[0])
    time = step * float(sums[window])
    return IntegralTime(time, time * math.sqrt(2.0 * (2.0 * window + 1.0) / (free * records)))


def correlation_time(dataset: xr.Dataset) -> xr.Dataset:
    """Integral correlation time of the fluctuation energy ΔΓ(t) at each point of the sweep.

    It has a meaning only while the process is stationary: it is nan wherever the speed changes
    during the run, and where ``integral_time`` says so.

    Returns
    -------
    xarray.Dataset
        ``correlation_time`` and ``correlation_time_sem`` [s] with the sweep's dimensions.
    """
    energy, speed = dataset.get("fluctuation_energy"), dataset["speed"]
    dims = sweep_dims(dataset)
    shape = tuple(dataset.sizes[name] for name in dims)
    times = np.full((2, *shape), np.nan)
    if energy is not None and _MEMBERS in energy.dims and dataset.sizes["t"] > 1:
        step = float(dataset["t"][1] - dataset["t"][0])
        steady = (speed == speed.isel(t=0)).all("t").broadcast_like(dataset["contact_modulus"])
        for where in np.ndindex(shape):
            point = dict(zip(dims, where, strict=True))
            if bool(steady.isel(point)):
                member_rows = energy.isel(point).transpose(_MEMBERS, "t").to_numpy().astype(float)
                times[(slice(None), *where)] = integral_time(member_rows, step)
    about = "integral correlation time of the fluctuation energy"
    coordinates = {name: dataset[name] for name in dims}
    return xr.Dataset(
        {
            "correlation_time": (dims, times[0], {"units": "s", "long_name": about, "symbol": "t_c"}),
            "correlation_time_sem": (dims, times[1], {"units": "s", "long_name": f"standard error of the {about}"}),
        },
        coordinates,
    )


_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_PREFIXABLE = re.compile(r"(?P<base>m|s|N|Pa|J)(?:\^(?P<power>\d))?(?P<rest>|[/ ].*)")


def scaled(magnitude: float, unit: str) -> tuple[float, str]:
    """Factor from SI to a unit with a prefix that suits a magnitude, and that unit as a reader writes it.

    >>> scaled(0.042, "J/m^2")
    (1000.0, 'mJ/m²')
    """
    match = _PREFIXABLE.fullmatch(unit)
    shown = unit.replace("^2", "²").replace("^3", "³")
    size = abs(float(f"{magnitude:.3e}"))
    if match is None or not (0.0 < size < math.inf):
        return 1.0, "" if unit == "1" else shown
    power = int(match["power"] or 1)
    # squares step by a million: 0.05 mm² reads better than 50 000 µm²
    exponent = 3 * math.floor((math.log10(size) + 2.0 * (power - 1) + 1e-12) / (3 * power))
    exponent = min(max(exponent, -15), 12)
    return 10.0 ** (-exponent * power), _PREFIXES[exponent] + shown


def engineering(value: float, unit: str) -> str:
    """A number with its unit, four digits at most, in the SI prefix that suits it.

    >>> print(engineering(1.203e-4, "m"), engineering(42e-3, "J/m^2"), engineering(4.55e-8, "m^2"))
    120.3 µm 42 mJ/m² 0.0455 mm²
    """
    factor, shown = scaled(value, unit)
    return f"{value * factor:.4g} {shown}".rstrip()


def concise(mean: float, sem: float) -> str:
    """A mean with its standard error in the last digits, as metrologists write it.

    Five digits of the mean at most: an error below half of the last one is told as ``(0)``. Without
    brackets there is no error, or it is not known.

    >>> print(concise(118.2312, 0.0423), concise(0.5, 0.013), concise(1234.0, 56.0), concise(12.5, 0.0))
    118.23(4) 0.500(13) 1230(60) 12.5
    >>> print(concise(118.2312, 0.0004))
    118.23(0)
    """
    if math.isnan(mean):
        return "–"
    if not sem > 1e-9 * abs(mean) or not math.isfinite(sem):
        return f"{mean:.4g}"
    decade = math.floor(math.log10(sem))
    places = -decade + (1 if sem < 2.0 * 10.0**decade else 0)
    if mean != 0.0:
        places = min(places, 4 - math.floor(math.log10(abs(mean))))
    digits = max(places, 0)
    return f"{round(mean, places) + 0.0:.{digits}f}({round(round(sem, places) * 10**digits)})"


class _Column(NamedTuple):
    """An observable's column; it is left out where all of its values are the ``dull`` one."""

    name: str
    heading: str
    dull: float = 0.0


_COLUMNS = (
    _Column("speed", "V", math.nan),
    _Column("bond_fraction", "N/N0", 1.0),
    _Column("fluctuation_energy", "ΔΓ"),
    _Column("work_of_adhesion", "w", math.nan),
    _Column("contact_radius", "a", math.nan),
    _Column("area_ratio", "A/A_JKR"),
    _Column("lost_to_bonds", "lost to\nbonds"),
    _Column("lost_to_fluctuations", "lost to\nfluct."),
    _Column("friction_force", "F"),
    _Column("fraction_detached", "open"),
    _Column("fraction_masked", "masked"),
)

#: Observables shown in percent.
_PERCENT = ("area_ratio", "lost_to_bonds", "lost_to_fluctuations", "fraction_detached", "fraction_masked")


def table(dataset: xr.Dataset, rows: int = 12) -> list[dict[str, str]]:
    """The statistics in about a dozen rows for the terminal.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    rows : int
        How many rows at most (at least one). Where the speed is steady each point of a sweep has one
        row, its mean over the second half of the run; else rows are spread evenly over time.

    Returns
    -------
    list of dict
        Cells by heading (of two lines, with the unit of the column). A number in brackets is the standard error in the
        last digits; columns that tell nothing (a friction of zero, no open contacts) are left out.
        "lost to bonds" and "lost to fluct." are the shares of JKR's area that each mechanism takes.
    """
    found, points = _tabulated(dataset, rows)
    cells: dict[str, list[str]] = {}
    for name, index in points.items():
        if name != "t" or not (is_steady(dataset) and sweep_dims(dataset)):
            heading, texts = _cells(name, found[name].attrs.get("units", "1"), found[name][index].to_numpy())
            cells[heading] = texts
    for name, heading, dull in _COLUMNS:
        if f"{name}_mean" in found:
            mean, sem = (
                found[f"{name}_{kind}"].broadcast_like(found["speed_mean"]).isel(points) for kind in ("mean", "sem")
            )
            if not np.all((mean == dull) | mean.isnull()):
                unit = "%" if name in _PERCENT else mean.attrs.get("units", "1")
                heading, texts = _cells(heading, unit, mean.to_numpy(), sem.to_numpy())
                cells[heading] = texts
    where = {name: index for name, index in points.items() if name != "t"}
    known = (found[name].isel(where).to_numpy() for name in ("correlation_time", "correlation_time_sem"))
    times, errors, _ = np.broadcast_arrays(*known, points["t"])
    if np.any(np.isfinite(times)):
        heading, texts = _cells("t_c", "s", times, errors)
        cells[heading] = texts
    return [dict(zip(cells, row, strict=True)) for row in zip(*cells.values(), strict=True)]


def _tabulated(dataset: xr.Dataset, rows: int) -> tuple[xr.Dataset, dict[str, xr.DataArray]]:
    """Statistics to tabulate, and the index of each row in every dimension of sweep and time."""
    trajectories = observables(dataset)
    with contextlib.suppress(ValueError):  # where the shares cannot be told the rest can
        trajectories = trajectories.merge(share_observables(dataset))
    dims = sweep_dims(dataset)
    if is_steady(dataset) and dims:
        trajectories = settled(trajectories)
    found = summary(trajectories).merge(correlation_time(dataset))
    counts = _thinned({name: dataset.sizes[name] for name in dims}, rows)
    counts["t"] = max(1, rows // math.prod(counts.values()))
    chosen = [_spread(found.sizes[name], count) for name, count in counts.items()]
    rowwise = (np.ravel(index) for index in np.meshgrid(*chosen, indexing="ij"))
    return found, {name: xr.DataArray(index, dims="row") for name, index in zip(counts, rowwise, strict=True)}


def _thinned(sizes: dict[str, int], rows: int) -> dict[str, int]:
    """How many values of each dimension make at most ``rows`` points, two of each at least."""
    counts = dict(sizes)
    while math.prod(counts.values()) > rows and max(counts.values()) > 2:
        longest = max(counts, key=lambda name: counts[name])
        counts[longest] -= 1
    return counts


def _spread(size: int, count: int) -> np.ndarray:
    """At most ``count`` indices evenly over ``size``, the last included."""
    count = min(size, max(count, 1))
    return np.rint(np.linspace(0 if count > 1 else size - 1, size - 1, count)).astype(int)


def _cells(heading: str, unit: str, values: np.ndarray, errors: np.ndarray | None = None) -> tuple[str, list[str]]:
    """Heading with its unit, and the column's cells in that unit."""
    if values.dtype.kind not in "fi":
        return heading, [str(value) for value in values]
    finite = np.abs(values[np.isfinite(values)])
    factor, shown = (100.0, "%") if unit == "%" else scaled(finite.max(initial=0.0), unit)
    errors = np.zeros(len(values)) if errors is None else errors
    texts = [concise(factor * value, factor * error) for value, error in zip(values, errors, strict=True)]
    gap = " " if "\n" in heading else "\n"
    return f"{heading}{gap}({shown})" if shown else heading, texts


def to_csv(dataset: xr.Dataset, path: str | os.PathLike) -> None:
    """Write all statistics at all times and sweep values as one long table.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    path : path
        The file: a comment line of provenance, a header with SI units in brackets, one row for each
        sweep value and time.
    """
    found = statistics(dataset)
    with contextlib.suppress(ValueError):  # where the shares cannot be told the rest can
        found = found.merge(shares(dataset))
    flat: dict[str, xr.DataArray] = {}
    for key, variable in found.data_vars.items():
        name = str(key)
        if "quantile" not in variable.dims:
            flat[name] = variable
            continue
        for level in QUANTILES:
            column = f"{name.removesuffix('_quantile')}_q{100 * level:02.0f}"
            flat[column] = variable.sel(quantile=level, drop=True)
    long = xr.Dataset(flat)
    units = {str(name): variable.attrs.get("units", "1") for name, variable in long.variables.items()}
    frame = long.to_dataframe(dim_order=[*sweep_dims(dataset), "t"]).reset_index()
    about = dataset.attrs
    told = (about.get("title", ""), f"sliding-sim {about.get('sim_version', '')}", about.get("history", ""))
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write("# " + " ".join("; ".join([*told, f"seed {about.get('seed', '')}"]).split()) + "\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([name if units[name] == "1" else f"{name} [{units[name]}]" for name in frame])
        writer.writerows(frame.itertuples(index=False, name=None))
