"""Reading the bench file again while it is served: at a signal, or a request answered once its model is in force."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread

from observer_rt.config.bench import Bench, changes, content_of
from observer_rt.daemon.control_socket import Message, Requests, control_socket, socket_places
from observer_rt.daemon.injector_service import InjectorService
from observer_rt.daemon.snapshot import SNAPSHOT
from observer_rt.daemon.state_file import model_hash
from observer_rt.foundation.errors import ObserverError, RunError, UserError
from observer_rt.foundation.stop_request import SignalledEvent, StopRequest
from observer_rt.foundation.version import __version__

Answer = Callable[[Message], Iterator[bytes]]
LIFT_DIED = (
    "warning: the needle lift shows no injection, has no value, or does not come: the needle goes by its commands\n"
    "  remedy: check the lift sensor, its amplifier and cable; it is used again once it shows an injection"
)
LIFT_LIVES = "the needle lift shows injections again, and is used"
RELOAD = "reload"  # name of the request; `model` in it and in the answer: SHA-256
_LOOK = 0.05  # s between two looks at what is asked for
_TURN = 0.001  # s between two looks whether an injection is under way
_PATIENCE = 2.0  # s that one is waited for
_LONGEST = 45.0  # s until an answer


@dataclass(frozen=True)
class _ReloadRequest:
    """Request to read the bench file again; model: SHA-256 of the model that the file is to name."""

    model: str
    answer: "Future[Message]" = field(default_factory=Future)

    def accept_or_refuse(self, bench: Bench) -> bool:
        """Whether the file names that model; else the request is answered by the refusal."""
        injector = bench.injector
        if (named := model_hash(injector.parameters)) == self.model:
            return True
        problem = f"names {injector.parameters_path} for the daemon, whose model is {named[:8]}, not {self.model[:8]}"
        remedy = "does the daemon serve this bench file, and see the same folder?"
        self.answer.set_exception(UserError(str(bench.path.absolute()), problem, remedy))
        return False


class Reloading:
    """Requests for the bench file to be read again, and their answers, whichever benches are served meanwhile."""

    def __init__(
        self, stop: StopRequest, read_again: Callable[[], Bench], say: Callable[[str], None], stack: ExitStack
    ) -> None:
        """read_again: the bench as its file is now, or `UserError`; say: logs a line; stack: closes the socket."""
        self._stop = stop
        self._read_again = read_again
        self._say = say
        self._waiting: deque[_ReloadRequest] = deque()
        self._taken: Sequence[_ReloadRequest] = ()  # whose bench is being read and made ready
        self._socket = stack.enter_context(ExitStack())
        self._places: tuple[Path, ...] = ()
        self._snapshot: Answer = lambda _: iter(())  # before a bench is served
        self.unsaved = ""
        """Problem of the last write before the bench that is served now, for the answer; empty: none."""

    def listen(self, bench: Bench, state: Path | None, snapshot: Answer) -> None:
        """Take requests where the bench file leads to. state: of the command line; snapshot: answers that request."""
        self._snapshot = snapshot
        places = socket_places(bench.injector, state)
        if places == self._places:
            return
        self._socket.close()
        self._places = places
        requests: Requests = {RELOAD: self._reload, SNAPSHOT: lambda request: self._snapshot(request)}
        failures = []
        for file in places:
            try:
                self._socket.enter_context(control_socket(file, requests, self._say))
                return
            except OSError as error:
                failures.append(f"{file}: {error.strerror}")
        self._say(
            f"warning: no requests can be taken beside {'; '.join(failures)}\n  remedy: let the daemon write "
            "there, on a local disk; SIGUSR1 has the bench file read all the same, `monitor` shows nothing"
        )

    @contextmanager
    def watching(self, bench: Bench, service: InjectorService) -> Iterator[tuple[Event, Callable[[], Bench | None]]]:
        """An event that ends the service, between events, and the bench, read and ready, that takes its place."""
        ended, successors, content = SignalledEvent(), list[Bench](), content_of(bench)

        def take_over() -> None:
            is_signalled = self._stop.reload.is_set()
            self._stop.reload.clear()
            after = self._read_again()
            self._taken = [request for request in self._taken if request.accept_or_refuse(after)]
            if not (self._taken or is_signalled):
                return
            if not (changed := changes(content, content_of(after))):
                self._say(f"{bench.path} is as it was: nothing to take over")
                self._settle(bench, service.model)
                return
            hand_over(after)
            self._say(f"{bench.path} is taken over: {'; '.join(changed)}")
            if after.config.realtime != bench.config.realtime:
                self._say("warning: [realtime] takes force with the next start of the process")
            ended.set()

        def hand_over(after: Bench) -> None:
            patience = time.monotonic() + _PATIENCE
            while not service.is_between_events and time.monotonic() < patience:
                time.sleep(_TURN)
            successors.append(after)

        def wait() -> None:
            self._settle(bench, service.model)
            while not ended.wait(_LOOK):
                self._taken = [self._waiting.popleft() for _ in range(len(self._waiting))]
                if self._taken or self._stop.reload.is_set():
                    try:
                        take_over()
                    except ObserverError as error:
                        self._say(f"warning: {bench.path} is not taken over, the one before goes on: {error}")
                        self.refuse(error)
                elif (other := service.other_bench) is not None:
                    hand_over(other)
                    self._say(LIFT_DIED if other.injector.is_lift_dead else LIFT_LIVES)
                    ended.set()

        thread = Thread(target=wait, name="reloading", daemon=True)
        thread.start()
        try:
            with self._stop.setting(ended):
                yield ended, lambda: next(iter(successors), None)
        finally:
            ended.set()
            if not self._stop.is_set():
                thread.join()

    def refuse(self, error: ObserverError) -> None:
        """Answer the requests for a bench that cannot be served."""
        for request in self._taken:
            if not request.answer.done():
                request.answer.set_exception(error)
        self._taken = ()

    def _settle(self, bench: Bench, model: str) -> None:
        """Answer the requests for the bench that is served now."""
        for request in self._taken:
            answer = {"model": model, "version": __version__, "bench": str(bench.path.absolute())}
            request.answer.set_result(answer | {"unsaved": self.unsaved})
        self._taken, self.unsaved = (), ""

    def _reload(self, request: Message) -> Message:
        asked = _ReloadRequest(str(request.get("model")))
        self._waiting.append(asked)
        try:
            return asked.answer.result(_LONGEST)
        except TimeoutError:
            raise RunError(f"the bench file was not taken over within {_LONGEST:g} s") from None
