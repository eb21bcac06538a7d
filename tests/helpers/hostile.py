"""Damaged and hostile files of four kinds, each drawn from its seed, and what the commands answer to them.

``python -m helpers.hostile KIND FIRST COUNT`` prints a line of JSON for each file: kind, seed, exit code, seconds,
and what is wrong with the answer.
"""

import contextlib
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import netCDF4
import numpy as np
import xarray as xr
from helpers.commands import sim

import sim as package
from tests.scenario.test_fuzz import (
    BESIDE,
    FILES,
    FOLDER,
    damaged,
    flip,
    insert_mark,
    remove_line,
    scale_number,
    truncate,
)

#: Longest answer [s], and what it may take of memory and of addresses [byte].
LONGEST, MEMORY, ADDRESSES = 20, 2**30, 4 * 2**30

LENS = """
[clock]
duration = "0.4 s"
step = "0.1 s"
[solid]
shear_modulus = "1.6 MPa"
[sphere]
radius = "2 mm"
[adhesion]
work = "42 mJ/m^2"
[contact]
load = "4 mN"
[drive]
model = "ramp"
from = "1 mm/s"
to = "20 mm/s"
"""
RUN = """
[bonds]
model = "counted"
critical_speed = "10 mm/s"
rebinding_rate = "500 1/s"
sites = 50
stress = "0.3 MPa"
[ensemble]
members = 3
[sweep]
"contact.load" = ["2 mN", "4 mN"]
"bonds.sites" = [20, 50]
"""
MAP = """
[shear]
model = "mean"
spectrum = { model = "measured", file = "map.nc", spacing = "5 um" }
"""
WORDS = ["", "x", "\x1b]0;x\x07", "\u202e", "9" * 50, "nan", "m" * 5000, "%s{0}", "$\\frac{", "/etc/passwd", "{}", "[1"]
NAMES = ["units", "symbol", "scale_factor", "add_offset", "missing_value", "long_name", "_Encoding", "coordinates"]
NAMES += ["calendar", "dtype"]
NUMBERS = [0, -1, 1e308, -1e-308, np.nan, np.inf, 2**31 - 1]
SIZES = [0, 1, 255, 2**16, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1]
#: What netCDF does not write.
UNWRITTEN = (RuntimeError, IndexError, ValueError, TypeError, AttributeError, OverflowError, OSError)
KINDS = ("scenario", "table", "map", "dataset")
#: Tables of the scenarios of the same names, and the command that reads each, with its options.
READ = {
    "jkr_test.csv": ["check"],
    "measured_lens.csv": ["fit", "measured_lens.csv", "--free", "bonds.critical_speed", "--steady", "--force"],
    "own_map.csv": ["check"],
    "own_psd.csv": ["check"],
}


def stretch(content, draw):
    """Overwrite a few bytes by a size."""
    value = SIZES[draw.integers(len(SIZES))].to_bytes(8, "little")[: int(draw.choice([1, 2, 4, 8]))]
    at = int(draw.integers(len(content)))
    return content[:at] + value + content[at + len(value) :]


def blank(content, draw):
    """Overwrite a stretch by one byte."""
    at, size = int(draw.integers(len(content))), int(draw.integers(1, 600))
    return content[:at] + bytes([int(draw.choice([0, 255]))]) * size + content[at + size :]


def moved(content, draw):
    """Overwrite a stretch by another."""
    size = int(draw.integers(1, 600))
    at, other = (int(place) for place in draw.integers(len(content), size=2))
    return content[:at] + content[other : other + size] + content[at + size :]


def mangled(content, draw, damages):
    for _ in range(int(draw.choice([1, 1, 2, 5, 20]))):
        content = damages[draw.integers(len(damages))](content, draw) or b"x"
    return content


def lied(path, draw):
    """Change attributes, names, types or sizes of a netCDF file by its own means."""
    with netCDF4.Dataset(path, "a") as file:
        names = list(file.variables)
        name = names[draw.integers(len(names))]
        value = (WORDS + NUMBERS)[draw.integers(len(WORDS) + len(NUMBERS))]
        deed = int(draw.integers(6))
        if deed == 0:
            file[name].setncattr(NAMES[draw.integers(len(NAMES))], value)
        elif deed == 1:
            file.renameVariable(name, "other")
        elif deed == 2:
            known = file.ncattrs() or ["title"]
            file.setncattr(known[draw.integers(len(known))], value)
        elif deed == 3 and file[name].ndim and file[name].dtype is not str:
            file[name][...] = NUMBERS[draw.integers(len(NUMBERS))] if file[name].dtype.kind == "f" else 1
        elif deed == 4:
            size = int(draw.choice([1, 10**4, 10**7, 10**12]))
            file.renameVariable(name, "other")
            file.createDimension("odd", size)
            file.createVariable(
                name, ["f8", "i1", "u8", str][draw.integers(4)], ("odd",), chunksizes=(min(size, 10**4),)
            )
        else:
            for attribute in file[name].ncattrs():
                file[name].delncattr(attribute)


class Folder:
    """A folder with sound files, which are damaged one by one."""

    def __init__(self, path):
        self.path = path
        os.chdir(path)
        for name, content in BESIDE.items():
            Path(name).write_text(content)
        Path("tables.toml").write_bytes(FILES)
        for name in READ:
            shutil.copy(FOLDER / f"{Path(name).stem}.toml", ".")
        Path("mapped.toml").write_text(LENS + MAP)
        package.run(tomllib.loads(LENS + RUN), "sound.nc")
        field = np.random.Generator(np.random.Philox(key=1)).standard_normal((2, 16, 16))
        maps = xr.Dataset({"shear_map": (("member", "x", "y"), field)}, {"x": 5e-6 * np.arange(16)})
        maps.to_netcdf("map0.nc", encoding={"shear_map": {"zlib": True, "chunksizes": (1, 8, 8)}})
        maps.to_netcdf("map1.nc", format="NETCDF3_CLASSIC")
        maps.to_netcdf("map2.nc", format="NETCDF3_64BIT")
        packed = {"dtype": "i2", "scale_factor": 1e-3, "add_offset": 0.0, "_FillValue": -9999}
        maps.to_netcdf("map3.nc", encoding={"shear_map": packed})

    def commands(self, kind, seed):
        """Damage a file and give the commands that read it."""
        draw = np.random.Generator(np.random.Philox(key=seed))
        binary = (flip, flip, stretch, stretch, blank, moved, truncate)
        if kind == "scenario":
            Path("x.toml").write_bytes(damaged(seed))
            return [["check", "x.toml"]]
        if kind == "table":
            name = sorted(BESIDE)[draw.integers(len(BESIDE))]
            damages = (flip, insert_mark, truncate, remove_line, scale_number, blank, moved)
            Path(name).write_bytes(mangled(BESIDE[name].encode(), draw, damages))
            command, *options = READ.get(name, ["check"])
            return [[command, f"{Path(name).stem}.toml" if name in READ else "tables.toml", *options]]
        source, target = (f"map{draw.integers(4)}.nc", "map.nc") if kind == "map" else ("sound.nc", "out.nc")
        shutil.copy(source, target)
        if draw.integers(3):
            Path(target).write_bytes(mangled(Path(source).read_bytes(), draw, binary))
        else:
            for _ in range(int(draw.integers(1, 4))):
                with contextlib.suppress(*UNWRITTEN):
                    lied(target, draw)
        if kind == "map":
            return [["check", "mapped.toml"]]
        drawn = [["plot", "out.nc", *(["time"], ["sweep"], ["curve"], [])[seed // 25 % 4], "--force"]]
        page = [["report", "out.nc", "--force"]]
        return [["stats", "out.nc", "--all"], *(drawn if seed % 25 == 0 else page if seed % 25 == 3 else [])]

    def restore(self):
        for name, content in BESIDE.items():
            Path(name).write_text(content)


def answers(kind, seeds, folder):
    """For each damaged file: kind, seed, exit codes, the longest answer [s of CPU], and what is wrong with it."""
    place = Folder(folder)
    for seed in seeds:
        codes, longest, wrong = [], 0.0, ""
        for command in place.commands(kind, seed):
            began = time.process_time()
            done = sim(*command)
            longest = max(longest, time.process_time() - began)
            codes.append(done.exit_code)
            if longest > LONGEST:
                wrong = f"{command[0]}: {longest:.0f} s"
            elif not isinstance(done.exception, SystemExit | None):
                wrong = f"{command[0]}: {type(done.exception).__name__}: {str(done.exception)[:200]}"
            elif done.exit_code not in (0, 2, *([1] if command[0] == "fit" else [])) or not done.output:
                wrong = f"{command[0]}: {done.exit_code}: {done.stderr[:200]}"
            elif not done.output.replace("\n", "").isprintable():
                wrong = f"{command[0]}: what is printed is not printable"
            elif command[0] == "report" and done.exit_code == 0 and "<script" in Path("out.html").read_text():
                wrong = "report: the page has a script"
        place.restore()
        yield kind, seed, codes, round(longest, 3), wrong


def main():
    kind, first, count = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    with tempfile.TemporaryDirectory() as folder:
        for answer in answers(kind, range(first, first + count), folder):
            signal.setitimer(signal.ITIMER_PROF, 2 * LONGEST)  # of what hangs in a library
            memory = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            print(json.dumps([*answer, memory]), flush=True)
        os.chdir("/")


if __name__ == "__main__":
    main()
