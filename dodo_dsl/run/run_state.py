"""The state of one test while it runs: how far it is, and what decides it."""

import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from dodo_dsl.application.ros_topics import BRIDGE
from dodo_dsl.check.senders import told_in_words
from dodo_dsl.outcome import ON_EMULATED, EndedService, MachineLoad, Outcome, Response, Result, ServiceUse
from dodo_dsl.plan.added_services import CLOCK, RECORDER, TIME
from dodo_dsl.plan.model import LAYERS, Plan
from dodo_dsl.run import start_order
from dodo_dsl.run.machine_load.judgement import JudgedFigures, consider
from dodo_dsl.run.outcomes import decide, flooded, how_it_ended, lost_messages, outcome_of
from dodo_dsl.run.protocol import (
    Cause,
    Event,
    Exited,
    Finding,
    Flooded,
    Foreign,
    GraphFinding,
    InputEnded,
    Late,
    MemoryTaken,
    Noted,
    Overrun,
    Paused,
    Ready,
    Responded,
    Started,
    Stopped,
    Time,
    VerdictEvent,
)
from dodo_dsl.run.sides import Backend

MOST_NOTES = 100
_MOST_OF_GRAPH = 3
"""What is said of a ROS graph in the reason of an outcome."""
_KILLED, _ASKED = ((-number, 128 + number) for number in (signal.SIGKILL, signal.SIGTERM))


def _how(event: Exited) -> str:
    return "ran out of memory" if event.out_of_memory else how_it_ended(event.code)


class Ended(Exception):
    """The test is over; what decided it is among the findings."""


@dataclass
class RunState:
    """Takes the events of one test. Times in s; ``began`` and ``finished`` by ``clock``, which never goes back."""

    plan: Plan
    clock: Callable[[], float]
    findings: list[Finding] = field(default_factory=list)
    verdicts: dict[str, list[VerdictEvent]] = field(init=False)
    first_application: str = field(init=False)
    """Whose last lines may explain why there is no answer."""
    layer_of: dict[str, str] = field(default_factory=dict)
    exits: dict[str, int] = field(default_factory=dict)
    ready: set[str] = field(default_factory=set)
    lost: dict[str, int] = field(default_factory=dict)
    late: dict[str, Late] = field(default_factory=dict)
    paused: dict[str, float] = field(default_factory=dict)
    load: MachineLoad | None = None
    has_started: bool = False
    response: Response | None = None
    notes: list[str] = field(default_factory=list)
    graph: list[str] = field(default_factory=list)
    began: float | None = None
    finished: float | None = None
    setup_s: float | None = None
    input_ended: bool = False
    buses: frozenset[int] = frozenset()
    """The CIDs of all buses that programs have joined in the application's networks, where these are the test's own."""
    time: Time | None = None
    resources: tuple[ServiceUse, ...] = ()
    _tails: dict[str, tuple[str, ...]] = field(default_factory=dict)
    _unmatched: Sequence[str] = ()

    def __post_init__(self) -> None:
        self.first_application = next((s.name for s in self.plan.application.services), "")
        self.verdicts = {s.name: [] for s in self.plan.services if s.judge}

    def test_s(self) -> float:
        if self.plan.lockstep:
            return self.time.seconds if self.time else 0.0
        return 0.0 if self.began is None else (self.finished or self.clock()) - self.began

    def all_evaluators_ended(self) -> bool:
        return self.verdicts.keys() <= self.exits.keys()

    def add_finding(self, result: Result, reason: str, service: str = "") -> None:
        self.findings.append(Finding(result, reason, service))

    def end(self, result: Result, reason: str, service: str = "", cause: Cause = "") -> None:
        """Adds a finding with which the test is over: raises Ended."""
        self._end_with(Finding(result, reason, service, cause))

    def _end_with(self, finding: Finding) -> None:
        self.findings.append(finding)
        raise Ended

    def time_out(self) -> None:
        """The test's time is over, and an evaluator has not ended: raises Ended."""
        late = next(name for name in self.verdicts if name not in self.exits)
        self.end("error", f"evaluator '{late}' gave no verdict within the timeout of {self.plan.timeout_s:g} s", late)

    def take(self, event: Event) -> None:
        """Remembers an event; raises Ended when the test is over with it."""
        match event:
            case VerdictEvent(service) if self.began is None:
                self.end("error", f"evaluator '{service}' gave a verdict before the test began", service)
            case VerdictEvent(service):
                self.verdicts[service].append(event)
            case Finding():
                self._end_with(event)
            case Flooded():
                self._end_with(flooded(self.plan, event))
            case MemoryTaken(service, text):  # no busy machine takes as long
                self.end("failed", f"the application keeps service '{service}' from its shared memory: {text}", service)
            case Foreign(reason):
                self.end("failed", reason, self.first_application)
            case Stopped():
                self._take_stop(event)
            case Exited(service, code):
                self.exits[service] = code
                self._take_exit(event)
            case _:
                self._remember(event)

    def _remember(self, event: Event) -> None:
        match event:
            case Ready(service):
                self.ready.add(service)
            case Overrun(service, messages):
                self.lost[service] = messages
            case Late(service):
                self.late[service] = event
            case Paused(service, seconds):
                self.paused[service] = seconds
            case GraphFinding(finding, "error") if len(self.graph) < MOST_NOTES:
                self.graph.append(finding)
            case GraphFinding(finding):
                self._remember(Noted(finding))
            case Noted(text) if len(self.notes) < MOST_NOTES:
                self.notes.append(text)
            case Noted() if len(self.notes) == MOST_NOTES:
                self.notes.append(f"there are more notes, and only {MOST_NOTES} are kept")
            case InputEnded():
                self.input_ended = True
            case Time():
                self.time = event
            case Started():
                self.has_started = True
            case Responded(answers):
                self.response = answers

    def _take_stop(self, event: Stopped) -> None:
        if event.how == "timedout":
            self.time_out()
        if event.how == "unanswered":
            self._end_with(Finding("failed", event.reason, self.first_application, "silence", event.silent))
        self.end("error", event.reason, CLOCK)

    def note_end(self, event: Exited, is_asked: bool) -> None:
        """Notes an end of the application's that decides nothing, unless it is a good one or by SIGTERM."""
        if self.layer_of.get(event.service) != "application" or event.code in (0, *_ASKED):
            return
        if is_asked and BRIDGE in self.layer_of and event.code == 1:
            return  # so ends a node of rclpy that does not catch the exception of its executor
        how = "did not end upon SIGTERM and was killed" if is_asked and event.code in _KILLED else _how(event)
        when = "as the test ended" if is_asked else "when all was judged"
        at = self._when() or (f"after {self.time.seconds:.1f} s of test time" if self.time else "")
        self._remember(Noted(f"application service '{event.service}' {how} {when}, {at}".rstrip(", ")))

    def _take_exit(self, event: Exited) -> None:
        service, code = event.service, event.code
        layer, when = self.layer_of.get(service, "application"), self._when()
        ended = f"{_how(event)} {when}".rstrip()
        if service == BRIDGE:
            self.end("error", f"the bridge to the application's ROS graph {ended}", service)
        if layer == "application":
            is_done = (code == 0 and self.input_ended) or start_order.may_end(
                self.plan.application.services, service, code
            )
            if not is_done and not all(self.verdicts.values()):
                reason = f"application service '{service}' {ended}, before the test was decided"
                self.end("failed", reason, service, "end")
            if not is_done:
                self.note_end(event, is_asked=False)
        elif code != 0:
            self.end("error", f"service '{service}' of layer {layer} {ended}", service, "end")
        elif service not in self.ready and self.began is None:
            self.end("error", f"service '{service}' of layer {layer} {ended}, before it was ready", service, "end")
        elif self.verdicts.get(service) == []:
            reason = f"evaluator '{service}' ended without a verdict {when}".rstrip()
            self.end("error", reason, service, "end")

    @property
    def finding(self) -> Finding:
        return decide(self.plan, self.findings, self.verdicts)

    def _details(self, finding: Finding, cid: int) -> list[str]:
        """What helps to understand why a test ended so, behind the reason; ``cid`` is that of its bus."""
        details = []
        if finding.silent and BRIDGE not in self.layer_of:
            details.append(f"the test is on CID {cid}")
            if others := sorted(self.buses - {cid}):
                details.append(f"the application talks on CID {others[0]}; write x-dodo: {{cid: {others[0]}}}")
        if finding.cause == "silence":
            details += self._unmatched
        if finding.result != "error":
            details.append(told_in_words(self.plan.told))
        return list(filter(None, details))

    def _when(self) -> str:
        if self.began is None:
            return "during set-up"
        return "" if self.plan.lockstep else f"after {(self.finished or self.clock()) - self.began:.1f} s"

    def _timed(self, finding: Finding) -> Finding:
        """With the time that the clock of a lockstep test had reached, where the end of a service decided."""
        is_decided_so = self.began is not None and finding.cause == "end"
        if not is_decided_so or not self.plan.lockstep or self.time is None or not self.time.last:
            return finding
        return replace(finding, reason=f"{finding.reason}, after {self.time.seconds:.1f} s of test time")

    def keep_tails(self, backend: Backend) -> None:
        """The test is decided: what services write from now on, because they are being ended, explains nothing."""
        names = {*self.layer_of, *self.verdicts, *(finding.service for finding in self.findings)}
        self._tails = {name: tuple(backend.tail(name)) for name in names}
        self._unmatched = backend.unmatched()

    def outcome(self, backend: Backend) -> Outcome:
        plan = self.plan
        services = [service.name for service in plan.application.services]
        figures = JudgedFigures()
        figures.judge_answers(self.response, plan.lockstep, services)
        figures.judge_use(self.resources, plan.resources)
        verdicts = [verdict for each in self.verdicts.values() for verdict in each]
        judged = [check for verdict in verdicts for check in verdict.checks]
        decided = decide(plan, self.findings, self.verdicts, figures.findings)
        considered, load = consider(decided, self._load())
        found = self._timed(considered)
        graph = [] if found.result == "passed" else self.graph[:_MOST_OF_GRAPH]
        finding = replace(found, reason="; ".join([*graph, found.reason, *self._details(found, backend.cid)]))
        losses = (lost_messages(s, self.lost[s.name]) for s in plan.services if s.name in self.lost)
        return replace(
            outcome_of(plan, finding, backend.name, backend.cid),
            setup_s=self.setup_s,
            execution_s=None if self.finished is None or self.began is None else self.finished - self.began,
            sim_s=self.time.seconds if self.time else None,
            services=tuple(self._service_rows()),
            checks=(*judged, *figures.checks),
            verdicts=tuple(verdict.as_json() for verdict in verdicts),
            last_lines=self._tails.get(finding.service, ()) if finding.result != "passed" else (),
            notes=(
                *([ON_EMULATED] if plan.rig and not plan.is_real else []),
                *self.notes,
                *self.graph[len(graph) :],
                *(() if finding.cause == "silence" or finding.result == "error" else self._unmatched),
                *losses,
                *figures.notes,
            ),
            machine=load,
            response=self.response,
            resources=self.resources,
        )

    def is_application(self, service: str) -> bool:
        """Whether a service is the application's, or was started by it."""
        return self.layer_of.get(service, "application") == "application"

    def _load(self) -> MachineLoad | None:
        """What was measured of the machine, with the lateness of DoDo's services; None in lockstep."""
        if self.began is None or self.finished is None or self.plan.clock != "realtime":
            return None
        memory = ("memory", "memories")  # of which they show pictures to the application
        cameras = self.plan.layer("environment")
        pictured = [s.name for s in cameras if any(flag.kind in memory for flag in s.flags)]
        late = {name: each for name, each in self.late.items() if name != RECORDER}  # of which no verdict depends
        shares = {name: each.late / each.updates for name, each in late.items()}
        load = self.load or MachineLoad(self.finished - self.began)
        return replace(
            load,
            late_pictures_share=max((share for name, share in shares.items() if name in pictured), default=0.0),
            late_updates_share=max((share for name, share in shares.items() if name not in pictured), default=0.0),
            lateness_s=max((each.worst_s for each in late.values()), default=0.0),
            paused_s=max(self.paused.values(), default=0.0),
        )

    def _service_rows(self) -> list[EndedService]:
        uses = {s.name: s.uses for s in self.plan.services}
        return [
            {"name": name, "layer": layer, "uses": uses.get(name), "exit_code": self.exits.get(name)}
            for name, layer in sorted(self.layer_of.items(), key=lambda item: (LAYERS.index(item[1]), item[0]))
            if name != TIME
        ]
