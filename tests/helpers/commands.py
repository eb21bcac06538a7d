"""Commands in this process, as a terminal would run them."""

import sys

import click
from click.testing import CliRunner

from sim import cli


def sim(*arguments):
    """A command as ``main`` runs it, in this process: exit code, output, errors."""
    return CliRunner().invoke(_main(), list(map(str, arguments)))


def _main():
    """``cli.main`` as a click command, so that the runner can catch what it prints."""

    @click.command(context_settings={"ignore_unknown_options": True, "help_option_names": []})
    @click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
    def run(arguments):
        before, sys.argv = sys.argv, ["sim", *arguments]
        try:
            cli.main()
        finally:
            sys.argv = before

    return run
