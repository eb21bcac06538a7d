"""The commands. Each imports its modules when it runs, so that ``sim --help`` is instant."""

import atexit
import contextlib
import gc
import io
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import click

from sim.units.terminal import (
    LOG,
    Notes,
    Shown,
    accept_all_letters,
    note,
    print_rows,
    print_table,
    progress_bar,
    say,
    signals,
    while_read,
)

DONE, FAILED, BAD_INPUT, EXISTS, TROUBLE, INTERRUPTED = 0, 1, 2, 73, 74, 130

_PATH = click.Path(path_type=Path)
_SET = click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="TABLE.KEY=VALUE",
    help="Replace a value of SCENARIO.",
)
_SEED = click.option(
    "--seed",
    type=click.IntRange(0, 2**64 - 1),
    help="Replace the seed of the random numbers.",
)
_MEMBERS = click.option(
    "--members",
    type=click.IntRange(1, 10**7),
    help="Replace the number of ensemble members.",
)
_FORCE = click.option("--force", is_flag=True, help="Replace files that exist.")
_UNITS = click.option(
    "--units",
    multiple=True,
    metavar="UNIT",
    help="Show values in UNIT, such as mm/s for speeds.",
)
_WHERE = click.option(
    "--where",
    "chosen",
    multiple=True,
    metavar="KEY=VALUE",
    help="Only this value of a swept key.",
)

_LOST = click.option(
    "--lost",
    multiple=True,
    metavar="SHARE",
    help="Add the speed at which SHARE of the area is lost.",
)

_STOPPED = (
    "stopped; the results so far are kept: the same command with --resume continues"
)
_CODES = (
    "Exit codes: 0 success; 1 failure; 2 bad input; 73 the output exists; 74 disk or file error; 75 interrupted"
    " (continue with --resume), or another run writes the output; 130 stopped at once."
)

#: Rows of a table on the terminal, and notes below tables.
_ROWS, _NOTES = 12, 5


def main() -> None:
    """Run the command line; every foreseen trouble ends in one message and its exit code."""
    # imports make many objects that stay: looking through them is a tenth of a start,
    gc.set_threshold(500_000)
    atexit.register(gc.freeze)  # and as much of the end
    # else what all packages declare is looked through
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    LOG.addHandler(notes := Notes())
    for order in signals("SIGTERM", "SIGHUP"):  # schedulers stop a run by these
        signal.signal(order, signal.default_int_handler)
    accept_all_letters()
    try:
        cli.main(standalone_mode=False)
    except (click.Abort, KeyboardInterrupt):
        _fail("stopped", INTERRUPTED)
    except click.ClickException as fault:
        shown = io.StringIO()
        fault.show(shown)
        _fail(shown.getvalue().rstrip("\n"), fault.exit_code)
    except MemoryError:
        _fail(
            "there is not enough memory; use fewer points, members or records (see `sim check`)",
            FAILED,
        )
    except (OSError, RuntimeError, ValueError) as trouble:
        if hasattr(trouble, "exit_code"):
            _fail(str(trouble), trouble.exit_code)
        if not isinstance(trouble, OSError) or trouble.strerror is None:
            raise
        _fail(f"{trouble.filename or 'files'}: {trouble.strerror}", TROUBLE)
    finally:  # a program that calls this function goes on to use the package
        LOG.removeHandler(notes)


def _fail(text: str, code: int) -> NoReturn:
    with contextlib.suppress(OSError):  # of a reader that is gone
        say(text, err=True)
    sys.exit(code)


def _announce_compiling(quiet: bool = False) -> None:
    """Announce the first kernel that is not in the cache, because its compilation takes seconds."""
    from sim.numerics import jit

    def announce(name: str) -> None:
        jit.on_compiling.clear()
        if not quiet:
            note(
                "compiling kernels, once per model (up to half a minute); `sim warm` compiles all"
            )

    jit.on_compiling[:] = [announce]


def _values(pairs: tuple[str, ...], option: str) -> dict[str, Any]:
    """Return the values that an option gives to keys, each read as TOML, else as text."""
    import tomllib

    values: dict[str, Any] = {}
    for pair in pairs:
        key, sign, text = pair.partition("=")
        if not sign or not key.strip():
            raise click.UsageError(
                f'{option} takes TABLE.KEY=VALUE, such as contact.load="2 mN", not {pair!r}'
            )
        try:
            document = tomllib.loads(f"value = {text}")
        except (ValueError, RecursionError):
            document = {}
        values[key.strip()] = document["value"] if len(document) == 1 else text.strip()
    return values


def _load(
    scenario: Path,
    changes: tuple[str, ...],
    seed: int | None = None,
    members: int | None = None,
    quiet: bool = False,
) -> Any:
    """Load a scenario with the values of --set, --seed and --members; print what they replace."""
    from sim.scenario.reader import load

    numbers = {"seed": seed, "ensemble.members": members}
    overrides = _values(changes, "--set") | {
        key: value for key, value in numbers.items() if value is not None
    }
    scene = load(scenario, overrides, option="--set")
    for line in () if quiet else scene.source.notes:
        note(f"note: {line}")
    return scene


class _Commands(click.Group):
    """Commands that succeed if the reader of their output stops early."""

    make_context = while_read()(click.Group.make_context)
    invoke = while_read()(click.Group.invoke)

    def format_commands(
        self, ctx: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the first sentence of each command, whole: click would cut it to a line."""
        rows = [
            (name, (command.help or "").partition("\n")[0])
            for name, command in sorted(self.commands.items())
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(package_name="sliding-sim", prog_name="sim")
def cli() -> None:
    """Adhesive sliding interfaces: a smooth sphere slides on a soft half-space.

    Bonds break and re-form, the shear stress fluctuates and stores elastic energy, and the contact
    follows JKR with the work of adhesion that is left. Begin with `sim new first.toml`, then
    `sim run first.toml`.
    """


@cli.command(epilog=_CODES)
@click.argument("scenario", type=_PATH)
@click.option(
    "-o", "--output", type=_PATH, help="The netCDF file. Default: outputs/<name>.nc."
)
@_SET
@_SEED
@_MEMBERS
@click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1),
    help="Processes. Default: one per core, fewer for short runs.",
)
@click.option(
    "--scheduler",
    default="",
    metavar="ADDRESS",
    help="Run on the dask cluster with this scheduler.",
)
@click.option(
    "--max-memory",
    metavar="SIZE",
    help="Limit of memory. Default: SIM_MAX_MEMORY, or the free memory.",
)
@click.option(
    "--max-time",
    metavar="TIME",
    help="Stop before this time, such as 8 h. Continue with --resume.",
)
@click.option(
    "--shard",
    metavar="I/N",
    help="Run part I of N in a job array. The last part writes the file.",
)
@click.option(
    "--force", is_flag=True, help="Replace an existing output or an unfinished run."
)
@click.option(
    "--resume",
    is_flag=True,
    help="Continue an unfinished run; the results are the same bit for bit.",
)
@click.option(
    "--within",
    metavar="ERROR",
    help="Choose the cheapest settings with at most this error, such as 1 %.",
)
@click.option(
    "--of",
    "of",
    metavar="NAMES",
    help="With --within: quantities, such as friction_force,contact_area.",
)
@click.option(
    "--budget",
    metavar="TIME",
    help="With --within: counted work that may be spent. Default: 60 s.",
)
@click.option("--quiet", is_flag=True, help="Print only errors.")
@click.option(
    "--no-table",
    "bare",
    is_flag=True,
    help="Do not print the table of statistics at the end.",
)
def run(
    scenario: Path,
    output: Path | None,
    jobs: int | None,
    scheduler: str,
    max_memory: str | None,
    max_time: str | None,
    shard: str | None,
    force: bool,
    resume: bool,
    quiet: bool,
    bare: bool,
    within: str | None,
    of: str | None,
    budget: str | None,
    **overrides: Any,
) -> None:
    """Run a scenario with its ensemble and sweep, and write a netCDF file."""
    target = output or Path("outputs") / f"{scenario.stem}.nc"
    from sim.ensemble.store import BlockFiles, parts_of, shard_of

    share = shard_of("1/1" if shard is None else shard)
    from sim.units.quantity import read_option

    _announce_compiling(quiet)
    until = time.monotonic() + read_option(
        max_time, "--max-time", "s", above=0, typical="8 h"
    )
    memory = read_option(max_memory, "--max-memory", "byte", above=0, typical="4 GB")
    scene = _load(scenario, **overrides, quiet=quiet)
    if force and resume:
        raise click.UsageError(
            "--resume continues an unfinished run, --force deletes it: give one of them"
        )

    from sim.ensemble import plan as plans, preview, simulate

    about, sentence = dict[str, str](), ""
    if goal := _goal(scene, within, of, budget):
        _import_xarray()
        from sim.study.within import answer

        # nothing is computed for an output that is refused
        simulate.claim(target, force or resume, simulate.files_read(scene))
        scene, sentence, about = answer(scene, goal)
    plan = plans.Plan.of(scene)
    if not any(plan.share(*share)):
        tasks = sum(1 for _ in plan.tasks())
        say(
            f"shard {shard} has nothing to compute: the most shards of this run: {tasks}"
        )
        return
    simulate.claim(target, force or resume, simulate.files_read(scene))
    from sim.ensemble.execute import orders

    parts: Any = BlockFiles(parts_of(target)) if resume else ()
    jobs, lines = preview.processes(plan, jobs, memory, share, parts)
    for line in (
        () if quiet else (*(f"note: {text}" for text in preview.remarks(plan)), *lines)
    ):
        note(line)
    how: dict[str, Any] = {
        "shard": share,
        "replace": force,
        "resume": resume,
        "jobs": jobs,
        "scheduler": scheduler,
    }
    with (
        contextlib.nullcontext(Shown())
        if quiet
        else progress_bar(plans.work(plan, *share)) as shown
    ):
        with orders() as ordered:
            how["stop"] = lambda: ordered() or time.monotonic() > until
            try:
                simulate.run(
                    scene,
                    target,
                    **how,
                    about=about,
                    memory=memory,
                    stage=shown.begin,
                    progress=shown.advance,
                )
            except (simulate.Stopped, KeyboardInterrupt) as stopped:
                _fail(_STOPPED, getattr(stopped, "exit_code", INTERRUPTED))
        solves_motion = scene.drive.solves_motion
        if tabulated := not (quiet or bare or shard) and preview.tabulated(plan):
            # the points of a large sweep take as much memory as its table
            del plan, scene
            shown.begin("table")
            tables = _tables_of(target)
    if tabulated:
        _print_tables(*tables)
    if sentence and not quiet:
        say(sentence)
    if not quiet:
        waits = f"shard {shard} is done; the last shard writes {target} (after a failure: --resume)"
        say(str(target) if target.exists() else waits)
    if (
        solves_motion
        and not shard
        and target.exists()
        and (sentence := _unresolved(target))
    ):
        _fail(f"{target}: {sentence}", FAILED)


def _goal(scene: Any, within: str | None, of: str | None, budget: str | None) -> Any:
    """Return the accepted error of the options, or else of the table ``[accuracy]``; None without any."""
    table = scene.accuracy
    if within is None and table is None:
        if of or budget:
            name = "--of" if of else "--budget"
            raise click.UsageError(
                f'{name} belongs to --within "1 %", which is missing'
            )
        return None
    from sim.units.errors import BadInput
    from sim.units.quantity import read_option

    error = (
        table.within
        if within is None
        else read_option(within, "--within", "1", above=0)
    )
    if not error < 1.0:
        raise BadInput([f"--within {within}: must be below 100 %"])
    names = () if table is None else table.of
    if of is not None:
        names = tuple(name.strip() for name in of.split(",") if name.strip())
    seconds = 60.0 if table is None else table.budget
    if budget is not None:
        seconds = read_option(budget, "--budget", "s", above=0)
    _import_xarray()
    from sim.study.within import Goal

    return Goal(error, names, seconds)


def _unresolved(target: Path) -> str:
    """Return a sentence on the trajectories of a run that were not resolved to the end, or "" without any."""
    from sim.read.tables import unresolved

    with _opened(target) as dataset:
        return unresolved(dataset)


def _tables_of(target: Path) -> tuple[Any, list[str]]:
    """Return the tables of a run that is done, and their notes; trouble with them is a note."""
    from sim import read

    try:
        with _opened(target) as dataset:
            trajectories = dataset.drop_dims("map_time", errors="ignore").load()
        # of a closed file, because an open one keeps what was read in its cache
        run = read.Run(trajectories)
        shown = read.tables_of(run, _ROWS)
        return shown, _chosen(read.notes(run, shown))
    except (MemoryError, OSError) as trouble:
        return [], [
            f"the output is complete, but its table could not be made: {trouble or 'not enough memory'}"
        ]


def _chosen(notes: Any, every: bool = False, has_all: bool = False) -> list[str]:
    """Return the notes that are printed: those that are needed, and five in all unless ``every`` one is wanted.

    The last one says how to see the others, and all columns unless the tables have them.
    """
    if every:
        return [*notes.needed, *notes.further, *notes.headings]
    room = max(_NOTES - 1 - len(notes.needed), 0)
    columns = "" if has_all else "all columns: sim stats FILE --show all; "
    more = f"{columns}all notes and the headings: --notes"
    return [*notes.needed, *notes.further[:room], more]


def _print_tables(tables: Any, notes: list[str]) -> None:
    for table in tables:
        print_table(table.rows, "", table.keys)
    for line in notes:
        say(line)


@cli.command()
@click.argument("scenario", type=_PATH)
@_SET
@_SEED
@_MEMBERS
def check(scenario: Path, **overrides: Any) -> None:
    """Preview a run: models, quantities in SI, error estimates, and its time, memory and file size."""
    from sim.ensemble.preview import preview

    _announce_compiling()
    say(preview(_load(scenario, **overrides)))


@cli.command()
@click.argument("output", type=_PATH)
@_WHERE
@click.option("--all", "whole", is_flag=True, help="Show all times and sweep values.")
@_LOST
@click.option(
    "--show",
    multiple=True,
    type=click.Choice(["losses", "slips", "all"]),
    help="Add the columns of a group: losses of area, slip events, or all.",
)
@click.option("--notes", "every", is_flag=True, help="Print all notes.")
@click.option(
    "--csv", type=_PATH, help="Also write these columns, at all times, to a CSV file."
)
@click.option(
    "--csv-all", type=_PATH, help="Also write all quantities in long form, in SI."
)
@_UNITS
@_FORCE
def stats(
    output: Path,
    chosen: tuple[str, ...],
    lost: tuple[str, ...],
    csv: Path | None,
    csv_all: Path | None,
    force: bool,
    **form: Any,
) -> None:
    """Print tables of ensemble statistics over time and sweep."""
    _import_xarray()
    from sim import read
    from sim.units.notation import in_units

    with _opened(output, chosen) as dataset, in_units(form["units"]):
        run = read.Run(dataset, lost)
        for path in filter(None, (csv, csv_all)):
            read.dataset.claim(dataset, output, path, force)
        # before any printing, as nobody may read it to its end
        if csv is not None:
            read.to_csv(run, csv, form["show"])
        if csv_all is not None:
            read.to_long_csv(run, csv_all)
        rows = sys.maxsize if form["whole"] else _ROWS
        shown = read.tables_of(run, rows, form["show"])
        notes = read.notes(run, shown)
        _print_tables(shown, _chosen(notes, form["every"], "all" in form["show"]))
        for path in filter(None, (csv, csv_all)):
            say(str(path))


#: Kinds of figures with their content and options, here because the help must not import what draws them.
_KINDS = {
    "loop": "Load and contact radius over displacement, and radius over load, with the pull-offs and JKR's"
    " equilibria. --data",
    "theories": "Contact area, simulated and by each theory, over shear stress and tangential force.",
    "stress": "Shear stress and bonds over speed, with each maximum; of a start, over time. --data",
    "stability": "Force amplitude of the spring over speed and stiffness, at increasing and decreasing speed,"
    " with theory.",
    "creep": "Displacement and speed of the slider over time under a prescribed force. A dotted line marks a"
    " runaway. --data",
    "holds": "Friction peak after a hold over the time held, with its growth per decade or the time after which it"
    " saturates.",
    "friction": "Friction force over time and over the slider's position. --data",
    "curve": "Contact area with the loss by each mechanism, energies and friction, over speed. --x --absolute --data",
    "sweep": "Contact radius, energies and friction over the first swept key. Each value of a further key is a"
    " curve. --x --absolute --data",
    "time": "Contact radius, energies, friction, and changing speed, load and displacement, over time. --x"
    " --absolute --data",
    "incipient": "Contact area over the tangential force before sliding, and the law A0 − αQ² if the loss grows as a"
    " square. --absolute",
    "map": "Last stress map of a member, or the map nearest to a time, and the displacement by this stress. --at",
    "histogram": "Distribution of a quantity (--x) over the members, and over the second half of a stationary"
    " run. --x",
    "survival": "Share of contacts not yet masked, or detached (--x first_detachment), over time, with 95 % intervals."
    " --x",
    "movie": "Movie (GIF, MP4) of one contact: its edge, over the stress if maps are recorded, with area and"
    " force over time. --absolute",
}


class _Plot(click.Command):
    """The command whose help lists the kinds of figures."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Kinds"):
            formatter.write_dl(list(_KINDS.items()))


@cli.command(cls=_Plot)
@click.argument("output", type=_PATH)
@click.argument("kind", required=False)
@click.option(
    "-o",
    "--picture",
    "to",
    type=_PATH,
    help="The picture. Default: beside the dataset.",
)
@_WHERE
@click.option(
    "--member",
    type=click.IntRange(0),
    help="Draw only this member of the ensemble; the first is 0.",
)
@click.option(
    "--at",
    metavar="TIME",
    help="Use the record or map nearest to this time, such as 1.3 s.",
)
@click.option(
    "--x",
    default="",
    metavar="NAME",
    help="Quantity of the x axis: t, another variable or a swept key.",
)
@click.option("--absolute", is_flag=True, help="Draw areas instead of shares.")
@click.option(
    "--size",
    default="",
    metavar="SIZE",
    help="Width and height of the picture, such as 3.4x2.6in.",
)
@click.option(
    "--xlim",
    default="",
    metavar="LOW:HIGH",
    help="Range of the x axis in its unit, such as 0.1:10.",
)
@click.option(
    "--ylim",
    default="",
    metavar="LOW:HIGH",
    help="Range of the y axis of the first panel in its unit.",
)
@click.option(
    "--from",
    "start",
    metavar="TIME",
    help="First time of a figure over time, such as 0.2 s.",
)
@click.option("--to", "stop", metavar="TIME", help="Last time of a figure over time.")
@_UNITS
@click.option(
    "--data", type=_PATH, help="Add measured points from a CSV file, as in `sim fit`."
)
@_FORCE
def plot(
    output: Path,
    kind: str | None,
    to: Path | None,
    chosen: tuple[str, ...],
    force: bool,
    **choices: Any,
) -> None:
    """Draw a figure. Without KIND, the first kind that fits the dataset is drawn.

    KIND may also be a statement, such as pull_off_load, which is drawn over the first swept key or --x. If OUTPUT is
    a scenario (.toml), its spectrum is drawn before any run. Every kind takes --where, --member, --units, --size,
    --xlim and --ylim, and the options beside its name. Kinds over time also take --from and --to.
    """
    _import_xarray()
    from sim.plots import kinds as plots

    choice = plots.Choices(**choices)
    if output.suffix == ".toml":
        say(str(plots.planned(output, kind, to, force, [*choice.chosen, *chosen])))
        return
    with _opened(output, chosen) as dataset:
        target, remark = plots.drawn(dataset, kind, output, to, force, choice)
        if remark:
            note(f"note: {choice.data}: {remark}")
        say(str(target))


@cli.command()
@click.argument("output", type=_PATH)
@click.option("-o", "--page", type=_PATH, help="The page. Default: beside the dataset.")
@_WHERE
@click.option("--data", type=_PATH, help="Add measured points from a CSV file.")
@_LOST
@_UNITS
@_FORCE
def report(
    output: Path,
    page: Path | None,
    chosen: tuple[str, ...],
    units: tuple[str, ...],
    force: bool,
    **beside: Any,
) -> None:
    """Write an HTML page on a run: question, answer, figure, table, limits, methods and commands."""
    _import_xarray()
    from sim.reports import written
    from sim.units.notation import in_units

    with _opened(output, chosen) as dataset, in_units(units):
        target = page or output.with_suffix(".html")
        written(dataset, output, target, force, **beside)
        say(str(target))


def _import_xarray() -> None:
    """Import xarray without pint and dask, whose import takes a second and whose arrays no command uses."""
    # which xarray looks for when it is imported
    dask = "dask.array" if "xarray" in sys.modules else "dask"
    hidden = dict.fromkeys({"pint", dask} - sys.modules.keys())
    sys.modules.update(hidden)  # type: ignore[arg-type]
    import xarray as xr

    xr.Dataset(coords={"t": [0.0]}).t.notnull()  # which looks for both
    for name in hidden:
        del sys.modules[name]


@contextlib.contextmanager
def _opened(path: Path, chosen: tuple[str, ...] = ()) -> Iterator[Any]:
    """Open a dataset at chosen values of its sweep."""
    _import_xarray()
    from sim import read
    from sim.read.dataset import lacking, open as opened

    with opened(path) as dataset:
        if message := lacking(dataset):
            note(f"note: {path}: {message}")
        yield read.where(dataset, _values(chosen, "--where"))


@cli.command()
@click.argument("scenario", type=_PATH)
@click.option(
    "-o",
    "--output",
    type=_PATH,
    help="The netCDF file. Default: outputs/<name>-converge.nc.",
)
@click.option(
    "--budget",
    default="60 s",
    show_default=True,
    help="Counted work for all settings together.",
)
@click.option(
    "--tolerance", help="Accepted error, such as 1 %. Default: that of the scenario."
)
@click.option(
    "--of",
    "of",
    metavar="NAMES",
    help="Compared, such as contact_area,friction_force:spread. Default: all in the scenario's table.",
)
@_SET
@_FORCE
def converge(
    scenario: Path,
    output: Path | None,
    budget: str,
    tolerance: str | None,
    of: str | None,
    changes: tuple[str, ...],
    force: bool,
) -> None:
    """Compare speed and error of models, tolerances and clock steps, and recommend a combination.

    Means and standard deviations of all quantities of the scenario's table are compared at all recorded times, and its
    events. With a spring or a prescribed force, means over the second half of the run are compared. The recommended
    combination is run against the finest one. Nothing is recommended if the results are not shown to converge as the
    clock step decreases.
    """
    from sim.units.quantity import read_option

    seconds = read_option(budget, "--budget", "s", above=0)
    accepted = (
        None
        if tolerance is None
        else read_option(tolerance, "--tolerance", "1", above=0, below=1)
    )
    scene = _load(scenario, changes)
    from sim.study.converge import study

    target = output or Path("outputs") / f"{scenario.stem}-converge.nc"
    names = tuple(name.strip() for name in (of or "").split(",") if name.strip())
    print_table(*study(scene, target, force, seconds, accepted, names), keys=1)


@cli.command(
    epilog="Exit codes: 0 success; 1 not converged; 2 bad input; 73 an output exists; 74 file error."
)
@click.argument("scenario", type=_PATH)
@click.argument("data", type=_PATH, nargs=-1, required=True)
@click.option(
    "--free", multiple=True, metavar="KEY[=LOW:HIGH]", help="Calibrate this key."
)
@click.option(
    "--per-table",
    multiple=True,
    metavar="KEY[=LOW:HIGH]",
    help="Calibrate this key, a value in each table.",
)
@click.option(
    "--common",
    multiple=True,
    metavar="COLUMN=SIZE",
    help="Error shared by all points, such as 2 %.",
)
@click.option(
    "--errors",
    multiple=True,
    metavar="[COLUMN=]SIZE",
    help="Errors of curves without them, as 2 % or 0.1 mN.",
)
@click.option(
    "--steady",
    is_flag=True,
    help="Fit steady sliding only, without corrections by runs.",
)
@click.option(
    "--compare",
    "judged",
    is_flag=True,
    help="Also compare mechanisms and theories by the data.",
)
@click.option(
    "--plan",
    "is_plan",
    is_flag=True,
    help="Plan a measurement at the conditions of DATA instead.",
)
@click.option(
    "--candidates",
    type=_PATH,
    help="With --plan: further points to choose from. Default: twenty speeds.",
)
@click.option(
    "--sims",
    type=click.IntRange(50),
    help="With --plan: data sets per truth. Default: 400.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    help="With --plan: seed of the errors. Default: that of the scenario.",
)
@click.option(
    "-o",
    "--output",
    type=_PATH,
    help="STEM of STEM_fit.toml, .json and .png. Default: scenario name.",
)
@_UNITS
@_SET
@_FORCE
def fit(
    scenario: Path,
    output: Path | None,
    changes: tuple[str, ...],
    force: bool,
    **options: Any,
) -> None:
    """Calibrate keys of a scenario to measured curves.

    DATA are CSV files with units. Their columns have names of variables of a dataset, such as contact_area. With --plan
    DATA needs conditions and errors only. STEM_plan.json is written, and STEM_plan.png if there are further points.
    """
    _announce_compiling()
    scene, stem = _load(scenario, changes), output or scenario.with_suffix("")
    planned = {name: options.pop(name) for name in ("candidates", "sims", "seed")}
    planned = {name: value for name, value in planned.items() if value is not None}
    if planned and not options["is_plan"]:
        raise click.UsageError(f"--{min(planned)} belongs to --plan, which is missing")
    if options.pop("is_plan"):
        from sim.study import plan
        from sim.units.errors import BadInput

        if (
            len(options["data"]) > 1
            or options["judged"]
            or options["steady"]
            or options["per_table"]
            or options["errors"]
        ):
            others = "--compare, --errors, --steady and --per-table"
            raise BadInput([f"--plan: takes one table, without {others}; omit these"])
        chosen = {name: options[name] for name in ("free", "common", "units")}
        shown = plan.carried_out(
            scene, options["data"][0], stem=stem, replaced=force, **chosen, **planned
        )
        has_converged = True
    else:
        from sim.study import fit

        result, shown = fit.carried_out(scene, stem=stem, replace=force, **options)
        has_converged = result.converged
    for rows, text in shown:
        print_table(rows, text, keys=1)
    sys.exit(DONE if has_converged else FAILED)


@cli.command()
def paper() -> None:
    """Reproduce every equation and number of the paper, one line each. Exit code 1 if any fails."""
    from sim.study.paper import checks

    results = checks()
    print_rows([line.row for line in results], keys=1)
    failed = sum(not line.holds for line in results)
    say(f"{len(results) - failed} of {len(results)} hold")
    sys.exit(FAILED if failed else DONE)


@cli.command()
@click.argument("scenario", required=False, type=_PATH)
@_SET
@click.option(
    "--data",
    type=_PATH,
    help="A CSV of measured curves, with columns as those of `sim fit`.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    help="Port of this machine. Default: a free one.",
)
@click.option(
    "--state",
    default="",
    metavar="LINK",
    help="Numbers from the address of another page.",
)
@click.option(
    "--browser/--no-browser", default=True, help="Open the page in a browser."
)
def explore(
    scenario: Path | None, changes: tuple[str, ...], browser: bool, **page: Any
) -> None:
    """Explore a scenario with sliders, on a page in the browser.

    Without SCENARIO it is the starter scenario. The page is open to this machine only. Needs the extra `explore`.
    """
    from importlib.resources import as_file, files

    from sim.explorer.server import Server, serve

    with (
        contextlib.nullcontext(scenario)
        if scenario
        else as_file(files("sim").joinpath("starter.toml")) as path
    ):
        scene = _load(path, changes)
    serve(Server(scene, **page), browser, say)


@cli.command()
@click.argument("name", default="first.toml", type=_PATH)
def new(name: Path) -> None:
    """Write a starter scenario with comments, and the schema by which an editor completes its keys."""
    from sim.numerics.files import OutputExists
    from sim.scenario.scenario import Scenario
    from sim.scenario.schema import write_schema, write_starter

    target = write_starter(name)
    say(f"{target}: run it with `sim run {target}`")
    try:
        write_schema(target.with_name("sim.schema.json"), Scenario)
    except OutputExists as fault:
        note(f"note: {fault}")


@cli.command()
def schema() -> None:
    """Print the JSON schema of scenario files."""
    import json

    from sim.scenario.scenario import Scenario
    from sim.scenario.schema import json_schema

    say(json.dumps(json_schema(Scenario), indent=2))


@cli.command()
@click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1),
    help="Number of processes. Default: one per core.",
)
def warm(jobs: int | None) -> None:
    """Compile all kernels now. Otherwise a run compiles each at its first use."""
    from sim.ensemble.execute import compile_missing

    say(compile_missing(jobs))
