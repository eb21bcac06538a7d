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
    """Run a command as ``main`` runs it, in this process; return exit code, output and errors."""

    @click.command(
        context_settings={"ignore_unknown_options": True, "help_option_names": []}
    )
    @click.argument("words", nargs=-1, type=click.UNPROCESSED)
    def run(words):
        before, sys.argv = sys.argv, ["sim", *words]
        try:
            cli.main()
        finally:
            sys.argv = before

    return CliRunner().invoke(run, list(map(str, arguments)))
