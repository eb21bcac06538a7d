import time, sys, numpy as np

sys.path.insert(0, ".")
from tests.helpers import scenes
import sim
import importlib
from sim.parts.shear import modal
from sim.numerics import noise
import inspect

print(inspect.signature(modal.renew_modes))
