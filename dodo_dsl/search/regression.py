"""A failure as a test of its own: the test searched, with other nominal values."""

import json
import os
import re

from dodo_dsl.search.findings import kind_of
from dodo_dsl.source import Scalar
from dodo_dsl.spec.instances.vary import Values
from dodo_dsl.spec.model import Spec

_NOT_WORD = re.compile(r"[^a-z0-9]+")
_MOST_WORDS, _MOST_NAME = 6, 90


def name_of(spec: Spec, reason: str, taken: set[str]) -> str:
    """A name that is not ``taken``: the test's and the first words of the reason."""
    words = [word for word in _NOT_WORD.split(kind_of(reason).lower()) if word][:_MOST_WORDS]
    base = "-".join([spec.location.stem, *words])[:_MOST_NAME].strip("-")
    numbered = (f"{base}-{number}" for number in range(2, len(taken) + 3))
    return base if base not in taken else next(name for name in numbered if name not in taken)


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
