"""Rules on all tests together, whatever else is wrong with some of them.

``out-of-cids``: no two tests on the host's network share a CID. ``out-of-range``: the deployment's network has room for
a test.
"""

from collections.abc import Iterator, Sequence

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check.resolve import ResolvedTest, isolation
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.spec.deployment import Deployment


def check_suite(
    tests: Sequence[ResolvedTest], deployment: Deployment, application: ApplicationSource | None
) -> Iterator[Diagnostic]:
    file = Span(str(deployment.file)) if deployment.file else None
    free = [isolation(test.spec, test.rig) for test in tests if reserved_cid(test, application) is None]
    if len(free) > len(deployment.cids) <= free.count("host"):
        message = f"{free.count('host')} tests on the host network, but only {len(deployment.cids)} CIDs"
        last = max(tests, key=lambda test: test.spec.slug)
        yield Diagnostic(file or last.spec.span("name"), "out-of-cids", message, "widen 'cids' in dodo.yml")
    isolated = [test for test in tests if isolation(test.spec, test.rig) == "network"]
    needed = {containers(test, application): test for test in isolated}
    if needed and (length := prefix(most := max(needed))) < deployment.subnets.prefixlen:
        message = f"a test has {most} containers and so needs a /{length}, but 'subnets' is {deployment.subnets}"
        hint = "give 'subnets' in dodo.yml more, such as 10.213.0.0/16"
        yield Diagnostic(file or needed[most].spec.span("name"), "out-of-range", message, hint)


def reserved_cid(test: ResolvedTest, application: ApplicationSource | None) -> int | None:
    """The CID of a test's rig, or that which is built into the application."""
    if test.rig and test.rig.cid is not None:
        return test.rig.cid
    return application.cid if application else None


def containers(test: ResolvedTest, application: ApplicationSource | None) -> int:
    """Those of a test: each service, the recorder, in lockstep the clock, and the one that holds the network."""
    own = len(application.services) if application else 0
    return len(test.spec.uses) + own + (3 if test.spec.is_stepped else 2)


SMALLEST = 28
"""The prefix of the smallest subnet of a test, with room for 13 containers."""
_TAKEN = 3
"""Addresses of a subnet that no container gets: the network's, the engine's own, and that of broadcasts."""


def prefix(containers: int) -> int:
    """The length of the prefix of the smallest subnet in which each container has an address."""
    return min(SMALLEST, 32 - (containers + _TAKEN - 1).bit_length())
