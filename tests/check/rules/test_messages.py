"""Names of messages in parameters and in the application's declarations."""

from pathlib import Path

import pytest

from dodo_dsl.check.service_rules import check_messages, check_own_messages
from dodo_dsl.opendlv.odvd import STANDARD_0_9
from tests.check.contexts import context, found, resolved

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


STEERING, FRAME = "opendlv.proxy.GroundSteeringRequest", "opendlv.sim.Frame"
OLD_FRAME = "float x; float y; float z; float roll; float pitch; float yaw;"


@pytest.mark.parametrize(
    ("definition", "takes", "said"),
    [
        (f"{STEERING} [id = 1090] {{ float groundSteering; float rate; }}", "", ""),
        (f"{STEERING} [id = 1090] {{ float angle; }}", "", ""),
        (f"{STEERING} [id = 1090] {{ double groundSteering; }}", "", f"'{STEERING}' is not as service 'dynamic-model'"),
        (f"{STEERING} [id = 1071] {{ float groundSteering; }}", "", f"'{STEERING}' is not as service 'dynamic-model'"),
        ("team.Angle [id = 1090] { float angle; }", "", f"id 1090 of 'team.Angle' is that of {STEERING}"),
        ("team.Angle [id = 1130] { float angle; }", "", ""),
        ("team.Pose [id = 1003] { float x; }", "", f"id 1003 of 'team.Pose' is that of {FRAME}"),
        (f"{FRAME} [id = 1001] {{ {OLD_FRAME} }}", "", ""),
        (f"{FRAME} [id = 1001] {{ {OLD_FRAME} }}", FRAME, ""),
        (f"{FRAME} [id = 1001] {{ float x; float y; float yaw; }}", "", ""),
        (f"{FRAME} [id = 1001] {{ float x; float y; float yaw; }}", FRAME, f"'{FRAME}' is not as service 'integrator'"),
    ],
)
def test_messages_of_the_deployment_that_services_of_dodo_use_otherwise(
    definition: str, takes: str, said: str, tmp_path: Path
) -> None:
    example = f"# dodo.yml\nmessages: [my.odvd]\n# my.odvd\nmessage {definition}\n"
    example += DECLARED.format(key="in", name=takes) if takes else ""
    problems = list(check_own_messages(context(example, tmp_path)))
    assert [problem.message.startswith(said) for problem in problems] == [True] * bool(said)
    assert all(problem.span.file.endswith("my.odvd") and problem.span.column == 9 for problem in problems)


@pytest.mark.parametrize("takes", [FRAME, STEERING])
def test_an_application_of_set_0_9_gets_its_frames(takes: str, tmp_path: Path) -> None:
    example = f"# dodo.yml\nmessages: [my.odvd]\n# my.odvd\n{STANDARD_0_9.read_text()}\n"
    test = resolved(example + DECLARED.format(key="in", name=takes), tmp_path)
    (pose,) = (service for service in test.services if service.manifest.name == "integrator")
    assert pose.texts["euler"] == ("true" if takes == FRAME else "false")
