"""A page to explore a scenario with sliders; it needs the extra ``explore``."""

from importlib.util import find_spec

from sim.units.errors import BadInput

if missing := [
    name
    for name in ("starlette", "uvicorn", "tomlkit", "lmfit")
    if find_spec(name) is None
]:
    raise BadInput(
        [
            f"{missing[0]} is missing; install it with: pip install '.[explore]' in the folder of the sources"
        ]
    )
