"""Work that ends its process or raises, for tests of workers, which import it."""

import os

from sim.ensemble import simulate

#: The group of members whose second block is deadly.
DEADLY = "point000001-group000000-block000001"


def advance(task, number, state):
    if task.names[number] == DEADLY:
        os._exit(3)
    return simulate.advance(task, number, state)


def advance_faulty(task, number, state):
    return (
        number / 0
        if task.names[number] == DEADLY
        else simulate.advance(task, number, state)
    )
