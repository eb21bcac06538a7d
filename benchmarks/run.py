"""Speed beside plain numpy and scipy, and goals: ``make bench``.

``python -m benchmarks.run [GROUP ...]`` measures all groups of rows or some, keeps them in ``benchmarks/results.json``
beside those of the other groups, and writes ``docs/speed.md`` and ``docs/speed_rows.md`` of all that is kept. With
``--write`` it measures nothing.
"""

import datetime
import json
import os
import platform
import sys
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
import scipy

from benchmarks import bonds, contact, fields, page, spring, whole
from benchmarks.timing import Bench, Row

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "benchmarks" / "results.json"
#: Each page with the function that writes it.
PAGES = {
    ROOT / "docs" / "speed.md": page.opening,
    ROOT / "docs" / "speed_rows.md": page.text,
}
#: One core for each program, and memory that is freed stays with the process.
ENVIRONMENT = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR")
}
ENVIRONMENT |= {
    "MALLOC_TRIM_THRESHOLD_": "1000000000",
    "MALLOC_MMAP_THRESHOLD_": "1000000000",
}
GROUPS: dict[str, Callable[[Bench], list[Row]]] = {
    group.__name__: group
    for group in (
        fields.banded,
        fields.modal,
        fields.mapped,
        bonds.counted,
        bonds.tracked,
        spring.spring,
        contact.radii,
        whole.commands,
        whole.first,
        whole.gallery,
        whole.statistics,
        whole.sweeps,
    )
}


def main() -> None:
    """Measure group by group, keep each, and write the page."""
    if any(os.environ.get(name) != value for name, value in ENVIRONMENT.items()):
        os.execve(
            sys.executable,
            [sys.executable, "-m", "benchmarks.run", *sys.argv[1:]],
            os.environ | ENVIRONMENT,
        )
    chosen = [] if sys.argv[1:] == ["--write"] else sys.argv[1:] or list(GROUPS)
    if unknown := set(chosen) - set(GROUPS):
        sys.exit(
            f"no group {', '.join(sorted(unknown))}; there are {', '.join(GROUPS)}"
        )
    results = (
        json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    )
    for name in chosen:
        rows = [row.stored for row in GROUPS[name](Bench())]
        for row in rows:
            print(*page.cells(Row(**row)), sep=" | ", flush=True)
        results[name] = {
            "date": str(datetime.date.today()),
            "machine": machine(),
            "rows": rows,
        }
        results = {group: results[group] for group in GROUPS if group in results}
        RESULTS.write_text(
            json.dumps(results, ensure_ascii=False, indent=1) + "\n", encoding="utf-8"
        )
    for path, text in PAGES.items():
        path.write_text(text(results), encoding="utf-8")


def machine() -> str:
    """Processor and versions."""
    cpu = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        cpu = next(
            (
                line.partition(":")[2].strip()
                for line in lines
                if line.startswith("model name")
            ),
            cpu,
        )
    versions = f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    return f"{cpu}, {os.cpu_count()} cores; {versions}, numba {numba.__version__}"


if __name__ == "__main__":
    main()
