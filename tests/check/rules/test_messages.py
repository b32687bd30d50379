"""Names of messages in parameters and in the application's declarations."""

from pathlib import Path

import pytest

from dodo_dsl.check.service_rules import check_messages
from tests.check.contexts import context, found

SIGNAL = """\
evaluation:
  signal: {{uses: continuous-signal, with: {{message: {name}, field: groundSteering, target: ../maps/plain}}}}
"""
DECLARED = """\
# docker-compose.yml
services: {{driver: {{image: driver, command: --cid=1, x-dodo: {{{key}: [{name}]}}}}}}
"""


def test_an_unknown_message_of_a_parameter(tmp_path: Path) -> None:
    (problem,) = check_messages(context(SIGNAL.format(name="opendlv.proxy.GroundSteeringReqest"), tmp_path))
    assert (problem.rule, problem.message) == (
        "unknown-message",
        "unknown message 'opendlv.proxy.GroundSteeringReqest'",
    )
    assert "'opendlv.proxy.GroundSteeringRequest'" in problem.hint


@pytest.mark.parametrize("key", ["in", "out", "answers"])
def test_an_unknown_message_of_the_application(key: str, tmp_path: Path) -> None:
    expected = [("unknown-message", "unknown message 'my.Own'")]
    assert found(check_messages, DECLARED.format(key=key, name="my.Own/3"), tmp_path) == expected


def test_messages_of_the_deployment_are_known(tmp_path: Path) -> None:
    own = "# dodo.yml\nmessages: [my.odvd]\n# my.odvd\nmessage my.Own [id = 3000] { float x [id = 1]; }\n"
    assert found(check_messages, own + DECLARED.format(key="in", name="my.Own/3"), tmp_path) == []
