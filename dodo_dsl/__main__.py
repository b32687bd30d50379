"""``python -m dodo_dsl`` and ``dodo``: the process exit, and nothing else."""

import sys


def run() -> None:
    try:
        from dodo_dsl.cli.main import main

        code = main(sys.argv[1:], sys.stdout, sys.stderr)
    except KeyboardInterrupt:
        code = 130
    sys.exit(code)


if __name__ == "__main__":
    run()
