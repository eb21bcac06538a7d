"""What becomes of runs whose file operations fail or that are killed: ``python -m benchmarks.reliability [NAME ...]``.

A small run of several groups and blocks is done again and again, each time with a fault at another of its file
operations (``faults.c``, below Python and HDF5), then gone on with. In the end its bytes must be those of a run that
nothing befell. The figures are kept in ``benchmarks/reliability.json`` and put into ``docs/reliability.md``. It needs a
C compiler, ``cc``.
"""

import collections
import contextlib
import ctypes
import errno
import hashlib
import json
import mmap
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import tomllib
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

ROOT = Path(__file__).parent.parent
SOURCE, RESULTS = Path(__file__).with_name("faults.c"), Path(__file__).with_name("reliability.json")
PAGE, MARKS = ROOT / "docs" / "reliability.md", ("<!-- figures -->", "<!-- end of figures -->")
#: Two points of a sweep, two groups of members and three blocks each: twelve parts.
SCENE = """
name = "a run with troubles"
seed = 11
[clock]
duration = "6 ms"
step = "1 ms"
[solid]
shear_modulus = "1.6 MPa"
[sphere]
radius = "2 mm"
[adhesion]
work = "42 mJ/m^2"
[contact]
load = "4 mN"
[drive]
model = "steady"
speed = "1 mm/s"
[bonds]
model = "counted"
critical_speed = "10 mm/s"
rebinding_rate = "500 1/s"
sites = 100
stress = "0.3 MPa"
[ensemble]
members = 3
[sweep]
"contact.load" = ["1 mN", "4 mN"]
"""
#: Codes that the documentation names; a run that was killed has none.
CODES = {0, 1, 2, 73, 74, 75}
CRASHED = 70
FAIL, SHORT, KILL, TORN = 1, 2, 3, 4


class Fault(NamedTuple):
    """What happens at a file operation, to the run and in words."""

    name: str
    mode: int
    error: int = 0
    lasting: bool = False


FAULTS = (
    Fault("disk full, from then on", FAIL, errno.ENOSPC, lasting=True),
    Fault("disk full, once", FAIL, errno.ENOSPC),
    Fault("input or output error, from then on", FAIL, errno.EIO, lasting=True),
    Fault("input or output error, once", FAIL, errno.EIO),
    Fault("permission denied, once", FAIL, errno.EACCES),
    Fault("interrupted system call, once", FAIL, errno.EINTR),
    Fault("half written, once", SHORT),
    Fault("all processes killed before it", KILL),
    Fault("all processes killed in the middle of a write", TORN),
)


class _State(ctypes.Structure):
    """What ``faults.c`` shares with all processes of a run."""

    _fields_ = [(name, ctypes.c_long) for name in ("count", "at", "mode", "error", "lasting", "fired")]
    _fields_ += [("under", ctypes.c_char * 256)]


class Ended(NamedTuple):
    """How a command ended: its exit code, minus a signal; what it said; its file operations; whether one failed."""

    code: int
    said: str
    operations: int
    fired: bool


class Runs:
    """Commands in processes that fail or are killed at a file operation in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "run.toml").write_text(SCENE, encoding="utf-8")

    def __enter__(self) -> "Runs":
        self._beside = contextlib.ExitStack()
        beside = Path(self._beside.enter_context(tempfile.TemporaryDirectory(prefix="faults-")))
        library, shared = beside / "faults.so", beside / "state"
        subprocess.run(["cc", "-O1", "-shared", "-fPIC", "-o", library, SOURCE, "-ldl"], check=True)
        shared.write_bytes(bytes(4096))
        with shared.open("r+b") as file:
            self._state = _State.from_buffer(mmap.mmap(file.fileno(), 4096))
        self._server = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.reliability", "serve"],
            cwd=ROOT,
            env=os.environ | {"LD_PRELOAD": str(library), "FAULTS_STATE": str(shared)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._beside.enter_context(self._server)
        return self

    def __exit__(self, *trouble: object) -> None:
        with self._beside:
            assert self._server.stdin
            self._server.stdin.close()

    def run(self, *more: str, fault: Fault | None = None, at: int = 0, largest: int = -1) -> Ended:
        """Run the scene into ``out.nc``; with a ``fault`` at operation ``at``, or files of so many bytes at most."""
        given, state = fault or Fault("none", FAIL), self._state
        state.count, state.at, state.fired, state.under = 0, at, 0, str(self.folder).encode()
        state.mode, state.error, state.lasting = given.mode, given.error, given.lasting
        arguments = ["run", str(self.folder / "run.toml"), "-o", str(self.folder / "out.nc"), "--quiet", "-j", "1"]
        assert self._server.stdin and self._server.stdout
        print(json.dumps([largest, *arguments, *more]), file=self._server.stdin, flush=True)
        code, said = json.loads(self._server.stdout.readline())
        operations, state.under = state.count, b""
        return Ended(code, said, operations, bool(state.fired))


def serve() -> None:
    """Do commands, each in a copy of this process, which has loaded what they need."""
    from sim import cli
    from sim.ensemble import netcdf, plan, simulate, workers  # noqa: F401  what a run imports
    from sim.scenario import reader

    plan._GROUP, plan._BLOCK_SECONDS = 2, 2e-5
    simulate.run(reader.load(tomllib.loads(SCENE)))  # the kernels
    for line in sys.stdin:
        said, to = os.pipe()  # holds more than any message
        with open(said) as read:
            child = os.fork()
            if not child:
                os.setsid()
                for stream in (1, 2):
                    os.dup2(to, stream)
                largest, *arguments = json.loads(line)
                resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
                sys.argv = ["sim", *arguments]
                _command(cli.main)
            os.close(to)
            code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            print(json.dumps([code, read.read()]), flush=True)


def _command(main: Callable[[], None]) -> NoReturn:
    """Do a command and end the process."""
    code = 0
    try:
        main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 0
    except BaseException:
        traceback.print_exc()
        code = CRASHED
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)


class Campaign:
    """Runs with faults, each gone on with and compared to a run without any; ``problems`` says what was not right."""

    def __init__(self, runs: Runs) -> None:
        self.runs, self.problems, self.codes = runs, list[str](), collections.Counter[str]()
        self.output, self.parts = runs.folder / "out.nc", runs.folder / "out.nc.parts"
        whole = runs.run()
        if whole.code:
            raise RuntimeError(f"the run without faults ended with {whole.code}: {whole.said}")
        self.operations, self.files = whole.operations, self._files()
        self.whole_parts = self._all_parts()
        self._clear()

    def _files(self) -> dict[str, bytes]:
        """Files beside the scenario, but the log, which may differ."""
        names = {path.name for path in self.runs.folder.iterdir()} - {"run.toml", "out.nc.log"}
        return {name: digest(self.runs.folder / name) for name in names}

    def _all_parts(self) -> dict[str, bytes]:
        """The parts of a run that was killed when all of them were there."""
        most: dict[str, bytes] = {}
        for share in (0.4, 0.5, 0.6, 0.7):
            self._clear()
            self.runs.run(fault=Fault("killed", KILL), at=int(share * self.operations))
            found = {path.name: digest(path) for path in self.parts.glob("*.part")}
            most = max(most, found, key=len)
        return most

    def _clear(self) -> None:
        for path in sorted(self.runs.folder.rglob("*"), reverse=True):
            if path.name != "run.toml":
                path.rmdir() if path.is_dir() else path.unlink()

    def history(self, *faults: tuple[Fault, int, int]) -> None:
        """A run with faults, each at an operation of so many processes, gone on with after each and then to its end."""
        what = ""
        for fault, at, jobs in faults:
            ended = self.runs.run("--resume", "-j", str(jobs), fault=fault, at=at)
            what += f"{fault.name} at {at} of -j {jobs}; "
            if ended.fired:
                self._look(ended, what)
        ended = self.runs.run("--resume")
        if ended.code != 0 or self._files() != self.files:
            names = sorted(path.name for path in self.runs.folder.iterdir())
            self.problems.append(f"{what}gone on with: {ended.code}, {names} {ended.said[-2000:]}")
        self._clear()

    def _look(self, ended: Ended, what: str) -> None:
        """Check the code, the words, and that all that is there is whole and as it should be."""
        killed = ended.code == -signal.SIGKILL
        self.codes["killed" if killed else str(ended.code)] += 1
        message = ended.said and not ended.said.startswith("note:")  # such as of a log that was not written
        explained = ended.code in CODES and "Traceback" not in ended.said and bool(message) == bool(ended.code)
        if not (killed or explained):
            self.problems.append(f"{what}{ended.code} {ended.said[-2000:]}")
        for path in (self.output, *self.parts.glob("*.part")):
            wanted = self.files[path.name] if path == self.output else self.whole_parts.get(path.name)
            if path.exists() and digest(path) != wanted:
                self.problems.append(f"{what}{path.name} is not what it should be")

    def faults(self, every: int = 1) -> None:
        """Two faults at every operation, or at some of them, all kinds in turn."""
        for at in range(1, self.operations + 1, every):
            for kind in (at // every, at // every + len(FAULTS) // 2):
                self.history((FAULTS[kind % len(FAULTS)], at, 1))

    def kills(self, count: int) -> None:
        """Kills of all processes of runs whose number of processes changes, until there were ``count``."""
        choose, kinds = random.Random(1), [fault for fault in FAULTS if fault.mode in (KILL, TORN)]
        while self.codes["killed"] < count:
            jobs = choose.sample((1, 2, 3, 5), 3)
            self.history(*((choose.choice(kinds), choose.randint(1, 400), one) for one in jobs))

    def limits(self, count: int) -> None:
        """Runs that may not make files beyond some size; the largest that they would make is the dataset."""
        self.runs.run()
        size = max(path.stat().st_size for path in self.runs.folder.iterdir())
        self._clear()
        for largest in range(0, size, -(-size // count)):
            ended = self.runs.run(largest=largest)
            self._look(ended, f"files of {largest} bytes at most: ")
            if ended.code != 74 or "out.nc" not in ended.said:
                self.problems.append(f"files of {largest} bytes at most: {ended.code} {ended.said}")
            self.history()

    def starts(self, count: int) -> None:
        """So many runs of one output that begin at once."""
        command = [sys.executable, "-m", "sim", "run", self.runs.folder / "run.toml", "-o", self.output, "--quiet"]
        subprocess.run(command, check=True, cwd=ROOT)  # of blocks of the usual size
        self.files = self._files()
        self._clear()
        begun = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=ROOT) for _ in range(count)]
        answers = [one.communicate()[1] for one in begun]  # of all, as parts of the usual size are no others' business
        for one, said in zip(begun, answers, strict=True):
            self._look(Ended(one.returncode, said, 0, False), f"one of {count} at once: ")
        self._clear()


def digest(path: Path) -> bytes:
    """SHA-256 of a file, or of nothing where it is a folder."""
    return hashlib.sha256(b"" if path.is_dir() else path.read_bytes()).digest()


#: Every campaign, how many times it goes by itself, and in words.
CAMPAIGNS: dict[str, tuple[int, str]] = {
    "faults": (1, "faults below Python, two at each of {operations} file operations where they apply"),
    "kills": (210, "`kill -9` of all processes, before an operation or in a write, of 1, 2, 3 and 5 workers in turn"),
    "limits": (25, "limits of the size of files, from nothing to that of the dataset"),
    "starts": (20, "starts at once on one output"),
}


def campaign(name: str, count: int) -> dict[str, Any]:
    """Go through a campaign: what it did, how the runs ended, and what was wrong."""
    with tempfile.TemporaryDirectory(prefix="reliability-") as folder, Runs(Path(folder)) as runs:
        done = Campaign(runs)
        getattr(done, name)(count)
        said = CAMPAIGNS[name][1].format(operations=done.operations)
        return {"what": said, "codes": dict(sorted(done.codes.items())), "problems": done.problems}


def table(found: dict[str, dict[str, Any]]) -> str:
    """The figures in Markdown."""
    lines = ["| what | times | ended with | lost, changed, left behind or unexplained |", "| --- | --- | --- | --- |"]
    for one in found.values():
        codes = one["codes"]
        ended = ", ".join(f"{code}: {count}" if code.isdigit() else f"{code} {count}" for code, count in codes.items())
        lines.append(f"| {one['what']} | {sum(codes.values()):,} | {ended} | {len(one['problems']) or 'nothing'} |")
    return "\n".join(lines)


def main() -> None:
    """Go through all campaigns or some, and write their figures."""
    chosen = sys.argv[1:] or list(CAMPAIGNS)
    if unknown := set(chosen) - set(CAMPAIGNS):
        sys.exit(f"no campaign {', '.join(sorted(unknown))}; there are {', '.join(CAMPAIGNS)}")
    kept = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    for name in chosen:
        kept[name] = campaign(name, CAMPAIGNS[name][0])
        print(table({name: kept[name]}), *kept[name]["problems"], sep="\n", flush=True)
        kept = {one: kept[one] for one in CAMPAIGNS if one in kept}
        RESULTS.write_text(json.dumps(kept, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(MARKS[0])
    PAGE.write_text(f"{before}{MARKS[0]}\n{table(kept)}\n{MARKS[1]}{rest.partition(MARKS[1])[2]}", encoding="utf-8")
    sys.exit(any(one["problems"] for one in kept.values()))


if __name__ == "__main__":
    serve() if sys.argv[1:] == ["serve"] else main()
