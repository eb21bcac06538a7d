"""Adhesive sliding interfaces: a smooth sphere slides on a soft half-space.

A scenario is a TOML file, a dictionary of the same tables and keys, or a ``Scenario``. The result of a run is an
``xarray.Dataset`` in SI units with named dimensions. What cannot be used raises ``BadInput``, all faults at once.

Remarks on what is read are warnings of the logger ``"sim"``, as of the standard ``logging``.

>>> import sim
>>> scene = sim.Scenario(
...     clock=dict(duration="1 s", step="0.1 s"),
...     solid=dict(shear_modulus="1.6 MPa"),
...     sphere=dict(radius="2 mm"),
...     adhesion=dict(work="42 mJ/m^2"),
...     contact=dict(load="4 mN"),
...     drive={"model": "ramp", "from": "0 mm/s", "to": "10 mm/s"},
...     bonds=dict(model="steady", critical_speed="10 mm/s", stress="0.3 MPa"),
... )
>>> dataset = sim.run(scene)
>>> dataset.contact_radius.isel(t=[0, -1]).round(6).values.tolist()
[0.00012, 0.000113]
>>> scene.with_values({"contact.lod": "2 mN"})
Traceback (most recent call last):
sim.units.errors.BadInput: contact.lod: is not a key; did you mean "load"?
"""

import contextlib
import importlib
import os
import pathlib
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from sim.units.errors import BadInput, naming

# what a function needs is imported where it is called, so that importing the package costs nothing
if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from sim.ensemble.preview import Preview
    from sim.explorer.server import Server
    from sim.reports import Methods, Page
    from sim.scenario.scenario import Scenario
    from sim.study.fit import Fit
    from sim.study.plan import Plan

Path = str | os.PathLike[str]
_FROM = {
    "Run": "sim.read.run",
    "Scenario": "sim.scenario.scenario",
    "load": "sim.scenario.reader",
}
_FOLDERS = ("laws", "plots", "read", "reports", "solid", "spectrum")
_FUNCTIONS = (
    "check",
    "converge",
    "explore",
    "fit",
    "methods",
    "open",
    "plan",
    "plot",
    "report",
    "run",
    "stats",
    "steady_curves",
)
__all__ = sorted([*_FROM, *_FOLDERS, *_FUNCTIONS, "BadInput"])


def run(
    scenario: "Scenario | Path | dict[str, Any]",
    to: Path | None = None,
    *,
    replace: bool = False,
    resume: bool = False,
    jobs: int = 1,
    progress: bool | Callable[[int], None] = False,
) -> "xarray.Dataset":
    """Run a scenario with its ensemble and its sweep.

    Parameters
    ----------
    scenario : Scenario, path or dict
        What to run.
    to : path, optional
        The netCDF file to make; without it everything stays in memory.
    replace : bool
        True if an existing file, and an unfinished run of it, may be replaced.
    resume : bool
        True to go on with an unfinished run of the same scenario; a finished one is left as it is.
    jobs : int
        Processes that share the work; the numbers are the same for any. The command takes one a core by itself.
    progress : bool or callable
        True shows a bar; a function is called with the number of member-steps done since its last call. Without it a
        long run tells its progress to the logger ``"sim"`` at the level INFO, after the remarks of ``check``.

    Returns
    -------
    xarray.Dataset
        The dataset; with ``to`` as ``open`` opens it, whose ``close()`` releases the file.

    Raises
    ------
    BadInput
        If the scenario cannot be used, or the file or an unfinished run of it is there and is neither replaced nor gone
        on with.
    RuntimeError
        If the error that the table ``[accuracy]`` accepts is not reached within its budget.
    """
    import logging

    from sim.ensemble.diagnosis import remarks
    from sim.ensemble.plan import Plan, work
    from sim.ensemble.simulate import run as simulate
    from sim.numerics.files import OutputExists
    from sim.units import notebook
    from sim.units.terminal import LOG, Shown, progress_bar, progress_lines

    scene, about = _scene(scenario), dict[str, str]()
    if scene.accuracy is not None:
        from sim.study.within import Goal, answer

        wanted = scene.accuracy
        goal = Goal(wanted.within, wanted.of, wanted.budget)
        scene, sentence, about = answer(scene, goal)
        LOG.info(sentence)
    plan = Plan.of(scene)
    for remark in remarks(plan) if LOG.isEnabledFor(logging.INFO) else ():
        LOG.info(remark)
    task = work(plan), "member-steps"
    display: contextlib.AbstractContextManager[Shown]
    if callable(progress):
        display = contextlib.nullcontext(Shown(progress))
    elif not progress:
        display = contextlib.nullcontext(progress_lines(*task, LOG.info))
    elif notebook.is_notebook():
        display = contextlib.nullcontext(notebook.bar(*task))
    else:
        display = progress_bar(*task)
    try:
        with display as bar:
            result = simulate(
                scene,
                to,
                replace=replace,
                resume=resume,
                jobs=jobs,
                progress=bar.advance,
                stage=bar.begin,
                about=about,
            )
    except Exception as fault:
        message = str(fault).replace("the same command", "the same call")
        message = message.replace("--resume", "resume=True").replace(
            "--force", "replace=True"
        )
        if isinstance(fault, OutputExists | BadInput):
            raise BadInput([message]) from None
        if message != str(fault):
            fault.args = (message,)
        raise
    return result if to is None else open(result)


def check(scenario: "Scenario | Path | dict[str, Any]") -> "Preview":
    """Describe a run: models, quantities in SI, error estimates, and its time, memory and file size."""
    from sim.ensemble.preview import preview

    return preview(_scene(scenario))


def open(path: Path) -> "xarray.Dataset":
    """Open the dataset of a run lazily, with named dimensions and units.

    Raises
    ------
    BadInput
        If there is no such file, or it is none of our datasets.
    """
    from sim.read import dataset

    return dataset.open(path)


def stats(
    dataset: "xarray.Dataset | Path",
    where: dict[str, Any] | None = None,
    show: "Sequence[str]" = (),
) -> "pandas.DataFrame":
    """Return the columns of the tables of ``sim stats`` in SI, a row for each sweep value and time.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As ``run`` makes it.
    where : dict, optional
        Values of swept keys, ``{"contact.load": "4 mN"}``.
    show : sequence of str
        Groups of further columns: ``"losses"`` of area, ``"slips"``, ``"all"``.

    Returns
    -------
    pandas.DataFrame
        See ``sim.read.frame``. ``Run(dataset).statistic(name)`` has any other quantity.
    """
    from sim.read import Run, frame

    # of files that were opened together numbers are read on use, in pieces
    return _plainly(
        lambda data: frame(Run(data.compute() if data.chunks else data), show),
        dataset,
        where,
    )


def plot(
    dataset: "xarray.Dataset | Path",
    kind: str | None = None,
    to: Path | None = None,
    where: dict[str, Any] | None = None,
    *,
    ax: "Axes | None" = None,
    **choices: Any,
) -> "Figure | Axes":
    """Draw a figure of a run, by default of the kind that fits best. Save it if ``to`` is a file.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As ``run`` makes it.
    kind : str, optional
        Name of the kind; without it the one that fits.
    to : path, optional
        The picture: PNG, PDF or SVG.
    where : dict, optional
        Values of swept keys, ``{"contact.load": "4 mN"}``.
    ax : matplotlib.axes.Axes, optional
        Axes in which the first panel is drawn, in place of a figure of its own.
    **choices
        ``member=3``, ``at="1.3 s"``, ``x="slider_position"``, ``absolute=True``, ``units=["mm/s"]``,
        ``data="measured.csv"``: see ``sim.plots.Choices``; ``KINDS[kind].takes`` says which of them a kind takes.

    Returns
    -------
    matplotlib.figure.Figure or matplotlib.axes.Axes
        The figure, whose ``axes`` are its panels, or the axes given.
    """
    from sim.plots.kinds import Choices, draw
    from sim.plots.style import save

    if unknown := choices.keys() - {*Choices._fields}:
        raise BadInput(
            [
                f"{sorted(unknown)[0]}: is no choice of a figure; there are: {', '.join(Choices._fields)}"
            ]
        )
    figure = _plainly(
        lambda run: draw(run, kind, Choices(ax=ax, **choices)), dataset, where
    )
    if to is not None:
        save(figure, pathlib.Path(to))
    return figure if ax is None else ax


def report(
    dataset: "xarray.Dataset | Path",
    to: Path | None = None,
    where: dict[str, Any] | None = None,
    *,
    data: "Path | dict[str, Any] | None" = None,
    lost: "Sequence[float | str]" = (),
) -> "Page":
    """Return the page of a run, which a notebook shows. Save it if ``to`` is a file.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As ``run`` makes it.
    to : path, optional
        The HTML file; an older one is replaced.
    where : dict, optional
        Values of swept keys, ``{"contact.load": "4 mN"}``.
    data : path or dict, optional
        Measured points, as ``plot`` takes them.
    lost : sequence of float or str
        Shares of the JKR area whose loss has a speed, ``["10 %"]``.

    Returns
    -------
    Page
        The text of the page.
    """
    from sim.reports import html, written

    is_file = isinstance(dataset, str | os.PathLike)
    source = pathlib.Path(dataset if is_file else "OUT.nc")
    points = pathlib.Path(data) if isinstance(data, str | os.PathLike) else data

    def page(run: "xarray.Dataset") -> "Page":
        if to is None:
            return html(run, source, points, lost)
        return written(run, source, pathlib.Path(to), True, points, lost)

    return _plainly(page, dataset, where)


def methods(
    dataset: "xarray.Dataset | Path", where: dict[str, Any] | None = None
) -> "Methods":
    """Return a paragraph of methods on a run, with references in BibTeX.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As ``run`` makes it.
    where : dict, optional
        Values of swept keys, ``{"contact.load": "4 mN"}``.

    Returns
    -------
    Methods
        ``text`` and ``bibtex``; printed, it is both.
    """
    from sim.reports import methods as described

    return _plainly(described, dataset, where)


def converge(
    scenario: "Scenario | Path | dict[str, Any]",
    budget: float | str = "60 s",
    of: "Sequence[str]" = (),
) -> "xarray.Dataset":
    """Compare speed and error of the models and settings of a scenario, with a ``budget`` of counted work [s].

    Compared are the names ``of``, such as ``"contact_area"`` or ``"fluctuation_energy:skewness"``; by default all that
    the scene's table shows, with their spreads. The attribute ``recommendation`` is the best combination.
    """
    from sim.study.converge import converge as study
    from sim.units.quantity import read_option

    seconds = read_option(budget, "budget", "s", above=0)
    return study(_scene(scenario), seconds, of=tuple(of))


def fit(
    scenario: "Scenario | Path | dict[str, Any]",
    data: "Path | Sequence[Path]",
    free: "Iterable[str]",
    common: dict[str, float] | None = None,
    steady: bool = False,
    per_table: "Iterable[str]" = (),
    errors: "str | Sequence[str]" = (),
) -> "Fit":
    """Calibrate keys of a scenario to measured curves.

    Parameters
    ----------
    scenario : Scenario, path or dict
        Its own values are where the search starts.
    data : path, or several
        CSV tables whose columns are named as variables of a dataset, with units, ``speed [mm/s]``,
        ``contact_area [mm^2]``, ``contact_area_error [%]``.
    free : iterable of str
        Keys, each ``"bonds.critical_speed"`` or, with bounds, ``"bonds.critical_speed=1 mm/s:1 m/s"``.
    common : dict, optional
        Relative errors that all points of a variable share, ``{"contact_area": 0.02}``.
    steady : bool
        Whether steady sliding is enough; else the scenario's own models have the last word.
    per_table : iterable of str
        Keys with a value in each table, as those of ``free``. The files name the tables.
    errors : str, or several
        Standard errors of curves that come without: ``"2 %"`` of each value, ``"0.1 mN"``, or of one variable,
        ``"contact_area=2 %"``. Without them equal errors along a curve are assumed, of the size of the scatter.

    Returns
    -------
    Fit
        ``scenario`` with the ``values`` found, their standard ``errors`` and 95 % ``intervals``, ``correlations`` and
        ``remarks``; of values per table also ``differences``, ``no_difference`` and the ``scenarios``.
    """
    from sim.study.fit import fit as study

    paths = [data] if isinstance(data, str | os.PathLike) else list(data)
    return study(
        _scene(scenario),
        [pathlib.Path(path) for path in paths],
        free,
        common,
        steady,
        per_table,
        [errors] if isinstance(errors, str) else errors,
    )


def plan(
    scenario: "Scenario | Path | dict[str, Any]",
    points: Path,
    free: "Iterable[str]",
    candidates: Path | None = None,
    common: dict[str, float] | None = None,
    sims: int = 400,
    seed: int | None = None,
) -> "Plan":
    """Return what a planned measurement can tell, and which further point helps most to tell mechanisms apart.

    Parameters
    ----------
    scenario : Scenario, path or dict
        The truth that is assumed.
    points : path
        A CSV table of conditions and standard errors, ``speed [mm/s], contact_area_error [%]``, without values.
    free : iterable of str
        Keys that will be fitted, as for ``fit``.
    candidates : path, optional
        A CSV table of further points; by default twenty speeds, from a tenth of the least to ten times the largest.
    common : dict, optional
        Relative errors that all points of a variable share, as for ``fit``.
    sims : int
        Simulated data sets for each truth.
    seed : int, optional
        Of the simulated errors, by default that of the scenario.

    Returns
    -------
    Plan
        ``numbers`` with the interval to expect for each key, ``probabilities`` of telling the mechanisms apart for each
        truth, ``points`` with the best further point first, ``advice`` in a sentence, and ``remarks``.

    Raises
    ------
    BadInput
        If a key has no effect, the table cannot be read or has no errors, or the drive needs runs.
    """
    from sim.study.plan import plan as study

    further = None if candidates is None else pathlib.Path(candidates)
    return study(
        _scene(scenario), pathlib.Path(points), free, further, common, sims, seed
    )


def steady_curves(
    scenario: "Scenario | Path | dict[str, Any]", speeds: "ArrayLike", time: float = 0.0
) -> "xarray.Dataset":
    """Curves of steady sliding: contacts that have slid at one speed for ever, with the mean of the fluctuations.

    Parameters
    ----------
    scenario : Scenario, path or dict
        What slides; of a sweep the first point.
    speeds : array_like, shape (speeds,)
        Sliding speeds V [m/s], above 0.
    time : float
        Time of the run at which the sphere is held as in the curves [s].

    Returns
    -------
    xarray.Dataset
        Variables of a run's dataset and the shares of JKR's area that each mechanism takes, over the dimension
        ``speed``. Shares are nan if JKR's contact is open.

    Examples
    --------
    The area of the lens in README at 1 mm/s, over that of JKR:

    >>> import sim
    >>> scene = sim.load("scenarios/pdms_lens.toml")
    >>> print(f"{float(sim.steady_curves(scene, [1e-3]).area_ratio[0]):.4f}")
    0.9807
    """
    import numpy as np

    from sim.study.curves import steady_curves as curves

    values = np.atleast_1d(np.asarray(speeds, float))
    if values.ndim != 1 or not np.all((values > 0.0) & np.isfinite(values)):
        raise BadInput(
            ["speeds: must be positive numbers in m/s, such as [1e-3, 1e-2]"]
        )
    return curves(_scene(scenario).points()[0], values, time)


def explore(
    scenario: "Scenario | Path | dict[str, Any]",
    data: Path | None = None,
    *,
    port: int = 0,
) -> "Server":
    """Explore a scenario with sliders, on a page in the notebook; it needs the extra ``explore``.

    Parameters
    ----------
    scenario : Scenario, path or dict
        Where the sliders start; of a sweep the first point.
    data : path, optional
        A CSV table of measured curves, as for ``fit``.
    port : int
        Port of this machine; 0 takes one that is free.

    Returns
    -------
    Server
        A notebook shows it as the page. ``address`` is that for a browser, ``close()`` ends it.

    Raises
    ------
    BadInput
        If the extra is not installed, the port is in use, or the scenario or the table cannot be used.
    """
    from sim.explorer.server import Server

    server = Server(
        _scene(scenario),
        port,
        None if data is None else pathlib.Path(data),
        framed=True,
    )
    server.begin()
    return server


def _scene(scenario: "Scenario | Path | dict[str, Any]") -> "Scenario":
    from sim.scenario.reader import load
    from sim.scenario.scenario import Scenario

    return scenario if isinstance(scenario, Scenario) else load(scenario)


def _plainly(
    function: Callable[..., Any],
    dataset: "xarray.Dataset | Path",
    where: dict[str, Any] | None,
) -> Any:
    """Return the result of a function of a dataset, or of a file with one; its faults become ``BadInput``."""
    from sim.read.dataset import checked, where as chosen

    with (
        naming(),
        open(dataset)
        if isinstance(dataset, str | os.PathLike)
        else contextlib.nullcontext(dataset) as data,
    ):
        return function(chosen(checked(data), where or {}))


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name == "__version__":
        from importlib.metadata import version

        return version("sliding-sim")
    if name in _FOLDERS:
        return importlib.import_module(f"sim.{name}")
    if name not in _FROM:
        raise AttributeError(f"module 'sim' has no attribute {name!r}")
    return getattr(importlib.import_module(_FROM[name]), name)


def __dir__() -> list[str]:
    return __all__
