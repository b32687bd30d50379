"""``metrics.txt`` in OpenMetrics, which GitLab compares between branches."""

from collections.abc import Mapping, Sequence
from typing import Any

from dodo_dsl.margins import worst_margin
from dodo_dsl.outcome import Outcome
from dodo_dsl.terminal import printable


def to_text(outcomes: Sequence[Outcome]) -> str:
    """Duration of set-up and execution, outcome, margins, every check's value, and what the application used.

    All are labelled with the test.
    """
    from prometheus_client import CollectorRegistry, Gauge
    from prometheus_client.openmetrics.exposition import generate_latest

    registry = CollectorRegistry()
    setup = Gauge("dodo_setup_seconds", "Time until all services were ready", ["test"], registry=registry)
    execution = Gauge("dodo_execution_seconds", "Time from ready to the end", ["test"], registry=registry)
    passed = Gauge("dodo_passed", "1 when the test passed", ["test"], registry=registry)
    value = Gauge("dodo_check_value", "Value of an evaluator's check", ["test", "check", "unit"], registry=registry)
    margin = Gauge(
        "dodo_check_margin", "Distance of the value to its limit", ["test", "check", "unit"], registry=registry
    )
    worst = Gauge("dodo_worst_margin", "Least margin of the checks, -1 to 1", ["test"], registry=registry)
    processor = Gauge("dodo_processor_seconds", "Processor time", ["test", "service"], registry=registry)
    memory = Gauge("dodo_peak_memory_bytes", "Most memory at any time", ["test", "service"], registry=registry)
    for outcome in outcomes:
        slug = printable(outcome.slug)
        passed.labels(slug).set(outcome.outcome == "passed")
        if outcome.setup_s is not None:
            setup.labels(slug).set(round(outcome.setup_s, 3))
        if outcome.execution_s is not None:
            execution.labels(slug).set(round(outcome.execution_s, 3))
        if (share := worst_margin(outcome)) is not None:
            worst.labels(slug).set(share)
        for use in outcome.resources:
            processor.labels(slug, printable(use.service)).set(round(use.processor_s, 3))
            memory.labels(slug, printable(use.service)).set(use.peak_memory_bytes)
        for check in outcome.checks:
            if check["value"] is not None:
                value.labels(slug, *_labels(check)).set(check["value"])
            if check.get("margin") is not None:
                margin.labels(slug, *_labels(check)).set(check["margin"])
    text: str = generate_latest(registry).decode()  # type: ignore[no-untyped-call]
    return text


def _labels(check: Mapping[str, Any]) -> tuple[str, str]:
    """A check's name and unit, which an evaluator has written, or somebody else a file of results."""
    return printable(check["name"]), printable(check.get("unit") or "")
