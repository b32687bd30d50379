"""Message specifications (``.odvd``): tokens, field types, parser, and the files that ship with DoDo."""

from pathlib import Path

STANDARD = Path(__file__).with_name("messages.odvd")
"""The messages of OpenDLV's standard set 1.0, of libcluon and of DoDo."""
STANDARD_0_9 = Path(__file__).with_name("messages-0.9.odvd")
"""What set 0.9 means by ids that 1.0 uses otherwise."""
