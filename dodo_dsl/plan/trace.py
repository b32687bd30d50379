"""From an error message about a generated file back to the line of the spec."""

import re

from dodo_dsl.plan.model import Place, Plan


def trace(plan: Plan, text: str) -> Place | None:
    """The place in the spec of the service that a message about compiled files names; None when it names none."""
    for service in sorted(plan.services, key=lambda s: -len(s.name)):
        if re.search(rf"(?<![\w-]){re.escape(service.name)}(?![\w-])", text):
            return plan.source_map.get(f"{service.layer}.{service.name}")
    return None


def traced(plan: Plan, text: str) -> str:
    """The message followed by that place."""
    place = trace(plan, text)
    return f"{text} ({place.file}:{place.line}:{place.column})" if place else text
