"""A failure as a test of its own: the test searched, with other nominal values."""

import json
import os
import re
from collections.abc import Sequence

from dodo_dsl.source import Scalar
from dodo_dsl.spec.instances.vary import Values
from dodo_dsl.spec.model import Spec

_NOT_WORD = re.compile(r"[^a-z0-9]+")
_MOST_NAME, _LEAST_OF_TEST = 60, 20
"""Characters of a name, as the schema has it, and those of the test's that it keeps at least."""


def name_of(spec: Spec, changed: Sequence[str], taken: set[str]) -> str:
    """A name that is not ``taken``: the test's and the ranges whose values are not nominal."""
    names = "-".join(word for name in changed for word in _NOT_WORD.split(name.lower()) if word)
    end = f"-fails-at-{names or 'nominal'}"
    for number in range(1, len(taken) + 2):
        last = end if number == 1 else f"{end[: _MOST_NAME - _LEAST_OF_TEST - len(taken)].rstrip('-')}-{number}"
        kept = spec.location.stem[: max(_MOST_NAME - len(last), _LEAST_OF_TEST)].rstrip("-")
        name = f"{kept}{last}"[:_MOST_NAME].rstrip("-")
        if name not in taken:
            return name
    raise AssertionError("there are more names than are taken")


def text_of(spec: Spec, name: str, values: Values, reason: str) -> str:
    """The file ``NAME/NAME.dodo.yml`` of the test's registry, where ``values`` are those that are not nominal."""
    base = os.path.relpath(spec.location.path, spec.location.root / name)
    lines = [
        "dodo: 1",
        f"name: {name}",
        f"extends: {_quoted(base)}",
        f"description: {_quoted(f'Found by dodo search: {reason}')}",
        "clock: lockstep",
    ]
    if spec.choice.values:
        chosen = ", ".join(f"{key}: [{_written(value)}]" for key, value in spec.choice.values)
        lines.append(f"matrix: {{{chosen}}}")
    if values:
        lines.append("vary:")
        lines += [f"  {key}: {{nominal: {_written(value)}}}" for key, value in values.items()]
    return "\n".join(lines) + "\n"


def _written(value: Scalar) -> str:
    return _quoted(value.text) if isinstance(value.value, str) else value.text


def _quoted(text: str) -> str:
    """A string of JSON, which is one of YAML too."""
    return json.dumps(text, ensure_ascii=False)
