"""The text of ``--help``, made from the manifest."""

import shlex
from collections.abc import Mapping
from typing import Any

from services.base.manifest import About, bounds, example, parameters, unit


def help_text(manifest: Mapping[str, Any]) -> str:
    """What the service does, its flags with units, bounds and defaults, and a line that runs."""
    known = parameters(manifest)
    command = " ".join(manifest["process"])
    lines = [f"{manifest['name']}: {manifest['description']}", "", f"usage: {command} --key=value ...", ""]
    for name, about in known.items():
        lines += [f"  --{name}  ({_facts(about)})", f"      {about['help']}"]
    lines.append("  --help")
    lines.append("      Show this help.")
    return "\n".join([*lines, "", f"example: {example_line(manifest)}"]) + "\n"


def example_line(manifest: Mapping[str, Any]) -> str:
    """A command that starts the service alone: with the manifest's example, or else with required flags."""
    known = parameters(manifest)
    required = [f"--{name}={example(about)}" for name, about in known.items() if about.get("required")]
    words = [f"--cid={example(known['cid'])}", *manifest["example"]] if "example" in manifest else required
    return shlex.join([*manifest["process"], *words])


def _facts(about: About) -> str:
    facts = [about["type"] + unit(about), ("one of " if about.get("choices") else "") + bounds(about)]
    if about.get("required"):
        facts.append("required")
    elif about.get("default") not in (None, [], ""):
        facts.append(f"default {example({'default': about['default'], 'type': about['type']})}")
    return ", ".join(fact for fact in facts if fact)
