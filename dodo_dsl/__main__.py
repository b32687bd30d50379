"""``python -m dodo_dsl`` and ``dodo``: the process exit, and nothing else."""

import io
import sys


def run() -> None:
    try:
        from dodo_dsl.cli.main import main

        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="replace")  # a terminal without a letter costs no test its verdict
        code = main(sys.argv[1:], sys.stdout, sys.stderr)
    except KeyboardInterrupt:
        code = 130
    sys.exit(code)


if __name__ == "__main__":
    run()
