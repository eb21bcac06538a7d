"""The rows that a person reads of a dataset."""

from sim import read


def rows_of(dataset, printed=read.table, **how):
    """Return the rows of a table of a dataset."""
    return printed(read.Run(dataset), **how).rows


def lines_of(dataset):
    """Return all notes on the printed tables of a dataset."""
    run = read.Run(dataset)
    return [line for group in read.notes(run, read.tables_of(run)) for line in group]
