"""dodo completion: print what lets a shell complete commands, options, tests, services and rigs."""

import argparse
from typing import TextIO

from dodo_dsl.cli.exits import Exit

EXAMPLES = """examples:
  dodo completion bash >> ~/.bashrc
  dodo completion zsh >> ~/.zshrc
  dodo completion fish > ~/.config/fish/completions/dodo.fish

A new shell completes 'dodo' then, by the program of this name on its PATH. In the shell that is open, bash for example:
eval "$(dodo completion bash)".
"""

SHELLS = ("bash", "zsh", "fish")


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="the shell that is to complete")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    from argcomplete.shell_integration import shellcode

    if options.shell == "zsh":  # whose own completion may not have been started
        stdout.write("(( $+functions[compdef] )) || { autoload -Uz compinit && compinit; }\n")
    stdout.write(shellcode(["dodo"], shell=options.shell) + "\n")
    return Exit.OK
