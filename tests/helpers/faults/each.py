"""Let each single call fail that touches the folder of an output, in processes that ``shim.c`` was loaded into.

Run as a program with the arguments of ``main``, or of ``study``, as JSON, it prints a line of JSON for each fault that
ended wrong, and the number of faults.
"""

import contextlib
import errno
import json
import mmap
import os
import shutil
import signal
import struct
import sys
from pathlib import Path

CALLS = (
    "open",
    "write",
    "pwrite",
    "ftruncate",
    "rename",
    "fsync",
    "mkdir",
    "unlink",
    "link",
    "flock",
)
_WRITES = ("write", "pwrite", "ftruncate", "rename", "fsync")
ERRORS = (errno.ENOSPC, errno.EIO)
#: Calls of a large dataset of which one fails, because each fault of it takes seconds.
THINNED = 12
STATE = struct.Struct(f"={4 + len(CALLS)}i")
#: Exit code of a command whose disk fails.
FAILED = 74
#: Seconds after which a command is taken for hanging.
_PATIENCE = 120


class Faults:
    """The state that the shim shares: the call that fails, and how often each was made."""

    def __init__(self, path):
        with open(path, "r+b") as file:
            self.memory = mmap.mmap(file.fileno(), STATE.size)

    def arm(self, call=None, number=0, onward=False, error=0):
        place = -1 if call is None else CALLS.index(call)
        self.memory[:] = STATE.pack(place, number, onward, error, *[0] * len(CALLS))

    def counts(self):
        return dict(zip(CALLS, STATE.unpack(self.memory)[4:], strict=True))


def here(words):
    """Run a command in this process; return its exit code."""
    from sim import cli

    sys.argv = ["sim", *words]
    try:
        cli.main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(bool(end.code))
    return 0


def command(words):
    """Run a command in a process of its own; return how it ended and its text."""
    text = Path(os.environ["FAULTS_FOLDER"]).with_name("text")
    child = os.fork()
    if not child:
        with text.open("wb") as file:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
        signal.alarm(_PATIENCE)
        status = 99
        try:
            status = here(words)
        finally:
            with contextlib.suppress(Exception):
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(status)
    ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return ended, text.read_text(encoding="utf-8", errors="replace")


def wrong(ended, text, output, whole):
    """Return the reason for which a fault ended wrong; "" if it ended in a message, or without harm."""
    if ended not in (0, FAILED):
        return f"ended with {ended}"
    if "Traceback" in text:
        return "a traceback"
    if ended and not text.strip():
        return "no message"
    if output.exists() and output.read_bytes() != whole:
        return "half a file"
    if not ended and not output.exists():
        return "success without a file"
    return ""


def cases(counts, calls, all_of_them, thinned=1):
    """Faults of some calls: all of them, or one of each kind, of the calls that write the output the last one.

    All are ``thinned``: of each kind every so many calls fail, and the last ones.
    """
    every = [
        (call, number, onward, error)
        for call in calls
        for number in range(1, counts[call] + 1)
        for onward in (False, True)
        for error in ERRORS
        if number % thinned == 1 % thinned or number > counts[call] - thinned
    ]
    chosen = {call: counts[call] if call in _WRITES else 1 for call in calls}
    return (
        every
        if all_of_them
        else [
            case for case in every if case[1:] == (chosen[case[0]], False, errno.ENOSPC)
        ]
    )


def tell(case, reason, text):
    """Print a fault that ended wrong."""
    call, number, onward, error = case
    fault = f"{call} {number}{'+' if onward else ''} {errno.errorcode[error]}"
    print(
        json.dumps({"fault": fault, "reason": reason, "text": text[-600:]}), flush=True
    )


def main(state, calls, all_of_them, words, again, large):
    """Let calls fail, all of them or one of each kind, and then run ``again``, which must write the output."""
    folder, faults, failed, made = (
        Path(os.environ["FAULTS_FOLDER"]),
        Faults(state),
        0,
        0,
    )
    output = folder / "out.nc"

    def begin():
        faults.arm()
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()

    if large:  # a large dataset is written by a process of its own
        from sim.ensemble import dataset

        dataset.IN_MEMORY = 0
    begin()
    # in this process, so that those of the faults have all modules and kernels
    assert not here(words)
    begin()
    ended, text = command(words)
    assert not ended, text
    counts, whole = faults.counts(), output.read_bytes()
    for case in cases(counts, calls, all_of_them, THINNED if large else 1):
        begin()
        faults.arm(*case)
        ended, text = command(words)
        met = faults.counts()[case[0]] >= case[1]
        faults.arm()
        reason = wrong(ended, text, output, whole) or (
            "" if met or not ended else "failed without a fault"
        )
        if not reason and ended:
            ended, later = command(again)
            reason = wrong(ended, later, output, whole) or (
                f"then {ended}: {later}" if ended else ""
            )
            left = sorted(path.name for path in folder.iterdir())
            reason = reason or ("" if left == [output.name] else f"left {left}")
        # a lock that is asked for once more makes a call that others do not make
        made += met
        failed += bool(reason)
        if reason:
            tell(case, reason, text)
    print(json.dumps({"faults": made, "counts": counts, "failed": failed}), flush=True)


def study(state, all_of_them, words):
    """Let calls of a study fail that replaces a dataset and a picture; each of them is the old one or the new one."""
    from sim.study import converge

    folder, faults, made, failed = (
        Path(os.environ["FAULTS_FOLDER"]),
        Faults(state),
        0,
        0,
    )
    older = {"out.nc": b"older dataset", "out.png": b"older picture"}

    def content():
        return {path.name: path.read_bytes() for path in folder.iterdir()}

    def begin():
        faults.arm()
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for name, old in older.items():
            (folder / name).write_bytes(old)

    def keep(*arguments):
        results.append(results[0] if results else compute(*arguments))
        return results[0]

    compute, results = converge.converge, []
    converge.converge = keep  # because measured times differ from run to run
    begin()
    # because only faults are told on the standard output
    with contextlib.redirect_stdout(sys.stderr):
        assert not here(words)
    begin()
    ended, text = command(words)
    assert not ended, text
    counts, newer = faults.counts(), content()
    for case in cases(counts, CALLS, all_of_them):
        begin()
        faults.arm(*case)
        ended, text = command(words)
        met = faults.counts()[case[0]] >= case[1]
        faults.arm()
        now = content()
        reason = wrong(
            ended,
            text,
            folder / "out.nc",
            newer["out.nc"] if not ended else now["out.nc"],
        )
        if not reason and now.keys() != older.keys():
            reason = f"left {sorted(now)}"
        if not reason and not all(
            each in (older[name], newer[name]) for name, each in now.items()
        ):
            reason = "half a file"
        made += met
        failed += bool(reason)
        if reason:
            tell(case, reason, text)
    print(json.dumps({"faults": made, "counts": counts, "failed": failed}), flush=True)


if __name__ == "__main__":
    task = json.loads(sys.argv[1])
    (main if "again" in task else study)(**task)
