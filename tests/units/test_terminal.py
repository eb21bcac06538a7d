"""Printing: outputs whose encoding lacks letters, and readers that leave."""

import errno
import io
import math
import sys

import pytest

from sim.units import terminal
from sim.units.terminal import (
    accept_all_letters,
    plain,
    print_rows,
    say,
    while_read,
    width,
)


@pytest.mark.parametrize("encoding", ["cp1252", "cp850", "ascii"])
@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_an_output_that_lacks_a_letter_keeps_the_sense_of_a_formula(
    encoding, stream, monkeypatch
):
    screen = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, stream, screen)
    accept_all_letters()
    say("N0 − N: ΔΓ/w = 3×10⁻² ± 1, 5 µm → 2 m²", err=stream == "stderr")
    printed = screen.buffer.getvalue().decode(encoding)
    assert printed.startswith("N0 - N: ") and "?" not in printed
    assert "DeltaGamma/w" in printed or "ΔΓ/w" in printed
    assert "10^-" in printed and "m2" not in printed


def test_columns_of_a_table_are_as_wide_as_what_is_written(monkeypatch):
    screen = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", screen)
    accept_all_letters()
    print_rows([{"ΔΓ": "3", "a": "-1"}, {"ΔΓ": "1 → 2", "a": "−2"}])
    screen.flush()
    lines = screen.buffer.getvalue().decode().splitlines()
    assert [line.split()[-1] for line in lines] == ["a", "-1", "-2"]
    assert len({len(line.rstrip()) for line in lines}) == 1


@pytest.mark.parametrize("columns", [20, 43, 44, 60, 61, 100])
def test_a_table_is_no_wider_than_the_terminal_and_each_part_has_the_columns_of_its_place(
    columns, monkeypatch, capsys
):
    monkeypatch.setattr(terminal, "width", lambda: columns)
    names = [f"number {k} (µm)" for k in range(6)]
    rows = [{"t (s)": str(k)} | dict.fromkeys(names, f"1234.{k}(5)") for k in range(3)]
    print_rows(rows, keys=1)
    parts = capsys.readouterr().out.split("\n\n")
    lines = [line for part in parts for line in part.splitlines()]
    assert max(len(line.rstrip()) for line in lines) <= columns
    # "t (s)" and six columns of nine letters, each after a gap of two
    in_a_part = (columns - 5) // 11
    assert len(parts) == math.ceil(6 / in_a_part)
    assert all("t (s)" in part for part in parts)
    assert sum(part.count("1234.2(5)") for part in parts) == 6


def test_a_pipe_is_100_columns_wide(monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    assert width() == 100


def test_a_utf_8_output_has_every_letter_as_it_is(monkeypatch):
    screen = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    monkeypatch.setattr(sys, "stdout", screen)
    accept_all_letters()
    say("N0 − N: ΔΓ µm² 测")
    assert screen.buffer.getvalue().decode().splitlines() == ["N0 − N: ΔΓ µm² 测"]


class Left(io.RawIOBase):
    """A pipe whose reader is gone: writing fails with an error of a number."""

    def __init__(self, number):
        super().__init__()
        self.number = number

    def writable(self):
        return self.number is not None

    def write(self, content):
        if self.number is None:
            return len(content)
        raise OSError(self.number, "a fault")


@pytest.mark.parametrize(
    ("number", "is_left"),
    [(errno.EPIPE, True), (errno.EINVAL, True), (errno.ENOSPC, False)],
)
def test_a_reader_that_leaves_ends_a_command_with_success_by_the_errors_of_all_systems(
    number, is_left, monkeypatch
):
    raw = Left(number)
    screen = io.TextIOWrapper(io.BufferedWriter(raw), encoding="utf-8")
    monkeypatch.setattr(sys, "stdout", screen)
    # which would close the output of the tests
    monkeypatch.setattr("os.dup2", lambda *numbers: None)
    with pytest.raises(SystemExit if is_left else OSError) as end, while_read():
        say("a line")
    assert not is_left or end.value.code == 0
    # so that the text that waits can be written when the stream is closed
    raw.number = None


def test_an_invalid_argument_of_another_file_is_not_a_reader_that_left(capsys):
    with pytest.raises(OSError, match="a disk"), while_read():
        say("a line")
        raise OSError(errno.EINVAL, "a disk")


def test_lines_that_end_as_on_windows_are_lines():
    assert plain("one\r\ntwo\r\n") == "one\ntwo\n"
    assert plain("one\rtwo") == "one?two"  # a terminal would write over the line
