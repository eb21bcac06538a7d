"""Let each single call fail that touches the folder of an output, in processes that ``shim.c`` was loaded into.

Run as a program with the arguments of ``main`` as JSON, it prints a line of JSON for each fault that ended wrong, and
the number of faults.
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

CALLS = ("open", "write", "pwrite", "ftruncate", "rename", "fsync", "mkdir", "unlink", "link", "flock")
_WRITES = ("write", "pwrite", "ftruncate", "rename", "fsync")
ERRORS = (errno.ENOSPC, errno.EIO)
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


def main(state, calls, all_of_them, words, again, large):
    """Let calls fail, all of them or one of each kind, and then run ``again``, which must write the output."""
    folder, faults, failed, made = Path(os.environ["FAULTS_FOLDER"]), Faults(state), 0, 0
    output = folder / "out.nc"

    def begin():
        faults.arm()
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()

    if large:  # a large dataset is written by a process of its own
        from sim.ensemble import dataset

        dataset.IN_MEMORY = 0
    begin()
    assert not here(words)  # in this process, so that those of the faults have all modules and kernels
    begin()
    ended, text = command(words)
    assert not ended, text
    counts, whole = faults.counts(), output.read_bytes()
    cases = [
        (call, number, onward, error)
        for call in calls for number in range(1, counts[call] + 1) for onward in (False, True) for error in ERRORS
    ]  # fmt: skip
    if not all_of_them:  # the last one of the calls that write the output
        chosen = {call: counts[call] if call in _WRITES else 1 for call in calls}
        cases = [case for case in cases if case[1:] == (chosen[case[0]], False, errno.ENOSPC)]
    for case in cases:
        begin()
        faults.arm(*case)
        ended, text = command(words)
        met = faults.counts()[case[0]] >= case[1]
        faults.arm()
        reason = wrong(ended, text, output, whole) or ("" if met or not ended else "failed without a fault")
        if not reason and ended:
            ended, later = command(again)
            reason = wrong(ended, later, output, whole) or (f"then {ended}: {later}" if ended else "")
            left = sorted(path.name for path in folder.iterdir())
            reason = reason or ("" if left == [output.name] else f"left {left}")
        made += met  # a lock that is asked for once more makes a call that others do not make
        failed += bool(reason)
        if reason:
            call, number, onward, error = case
            words_of = f"{call} {number}{'+' if onward else ''} {errno.errorcode[error]}"
            print(json.dumps({"fault": words_of, "reason": reason, "text": text[-600:]}), flush=True)
    print(json.dumps({"faults": made, "counts": counts, "failed": failed}), flush=True)


if __name__ == "__main__":
    main(**json.loads(sys.argv[1]))
