"""Bad input."""


class BadInput(ValueError):
    """Input that cannot be used; ``problems`` holds one line for each fault."""

    exit_code = 2

    def __init__(self, problems: list[str]):
        super().__init__("\n".join(problems))
        self.problems = problems
