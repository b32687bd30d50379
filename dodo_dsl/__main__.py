"""``python -m dodo_dsl`` is ``dodo``."""

from dodo_dsl.cli.main import run

run()
