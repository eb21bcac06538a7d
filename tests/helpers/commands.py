"""Commands in this process, as a terminal would run them."""

import sys

import click
from click.testing import CliRunner

from sim import cli

#: A lens under a load; a ramp of its speed; bonds that are random.
LENS = """\
name = "a scene"
[clock]
duration = "1 s"
step = "0.1 s"
[solid]
shear_modulus = "1.6 MPa"
[sphere]
radius = "2 mm"
[adhesion]
work = "42 mJ/m^2"
[contact]
load = "4 mN"
"""
RAMP = """\
[drive]
model = "ramp"
from = "1 mm/s"
to = "20 mm/s"
"""
COUNTED = """\
[bonds]
model = "counted"
critical_speed = "10 mm/s"
rebinding_rate = "500 1/s"
sites = 50
stress = "0.3 MPa"
"""
#: A small scene of them.
SCENE = f"{LENS}{RAMP}{COUNTED}[ensemble]\nmembers = 3\n"


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
