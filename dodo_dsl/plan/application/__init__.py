"""The application's compose file: read with positions, and rewritten in a copy so that a test has it to itself.

``load`` finds all files and merges them as compose does, ``source`` judges the result, ``rewrite`` makes the copy.
"""

from dodo_dsl.plan.application.model import SANDBOX, ApplicationSource, Declared
from dodo_dsl.plan.application.rewrite import plan_application
from dodo_dsl.plan.application.source import read_application

__all__ = ["SANDBOX", "ApplicationSource", "Declared", "plan_application", "read_application"]
