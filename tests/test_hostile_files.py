"""Damaged tables: each is used, or refused in plain words and with exit code 2."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers.commands import sim

from tests.scenario.test_fuzz import BESIDE, FILES, FOLDER, flip, insert_mark, remove_line, scale_number, truncate

#: Tables of the scenarios of the same names, and the command that reads each, with its options.
COMMANDS = {
    "jkr_test.csv": ["check"],
    "measured_lens.csv": ["fit", "measured_lens.csv", "--free", "bonds.critical_speed", "--steady", "--force"],
    "own_map.csv": ["check"],
    "own_psd.csv": ["check"],
}
DAMAGES = (flip, insert_mark, truncate, remove_line, scale_number)


@pytest.mark.filterwarnings("ignore")  # of numbers beyond all measure
@pytest.mark.parametrize("seeds", [range(10_001, 10_007), pytest.param(range(1000), marks=pytest.mark.verify)])
def test_damaged_tables_are_used_or_refused_in_plain_words(tmp_path, monkeypatch, seeds):
    monkeypatch.chdir(tmp_path)
    for name, content in BESIDE.items():
        Path(name).write_text(content, encoding="utf-8")
    Path("tables.toml").write_bytes(FILES)
    for name in COMMANDS:
        shutil.copy(FOLDER / f"{Path(name).stem}.toml", ".")
    for seed in seeds:
        draw = np.random.Generator(np.random.Philox(key=seed))
        name = sorted(BESIDE)[draw.integers(len(BESIDE))]
        content = BESIDE[name].encode()
        for _ in range(int(draw.choice([1, 1, 2, 5, 20]))):
            content = DAMAGES[draw.integers(len(DAMAGES))](content, draw) or b"x"
        Path(name).write_bytes(content)
        command, *options = COMMANDS.get(name, ["check"])
        done = sim(command, f"{Path(name).stem}.toml" if name in COMMANDS else "tables.toml", *options)
        assert isinstance(done.exception, SystemExit | None), (seed, done.exception)
        assert done.exit_code in (0, 2, *([1] if command == "fit" else [])) and done.output, seed
        assert done.output.replace("\n", "").isprintable(), seed
        Path(name).write_text(BESIDE[name], encoding="utf-8")
