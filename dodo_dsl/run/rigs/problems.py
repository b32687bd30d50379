"""What can go wrong with a rig."""

from dodo_dsl.run.protocol import BackendError


class RigProblem(BackendError):
    """A rig cannot do what was requested; ``usage`` when the request was not allowed."""

    def __init__(self, text: str, usage: bool = False) -> None:
        super().__init__(text)
        self.usage = usage


class ProgramTimeout(RigProblem):
    """The rig's program hung, as it does when the rig hangs."""
