"""For services of which there is only the manifest so far: specs that use them are checked and compiled."""

from typing import NoReturn

from services.base.service import Context


def build(context: Context) -> NoReturn:
    """There is nothing to build yet; raises ValueError with the sentence that a runner shows."""
    raise ValueError(f"the program of {context.name} comes with a later version; this one has its manifest only")
