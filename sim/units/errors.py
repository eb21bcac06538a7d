"""Bad input."""

import contextlib
from collections.abc import Iterator


class BadInput(ValueError):
    """Input that cannot be used; ``problems`` holds one line for each fault."""

    exit_code = 2

    def __init__(self, problems: list[str]):
        super().__init__("\n".join(problems))
        self.problems = problems


@contextlib.contextmanager
def naming(source: object = "") -> Iterator[None]:
    """Raise a ``ValueError`` as ``BadInput`` of one line, which begins with its source if that has a name."""
    try:
        yield
    except BadInput:
        raise
    except ValueError as fault:
        raise BadInput([f"{source}: {fault}" if source else str(fault)]) from None
