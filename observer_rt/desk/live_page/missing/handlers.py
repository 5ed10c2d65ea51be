"""The page of the missing effect on the server: what it shows, and what its buttons do, for whoever has the word."""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

from tornado.web import RequestHandler

from observer_rt.config.bench import Bench
from observer_rt.desk.live_page.missing.panel import panel_html
from observer_rt.desk.live_page.missing.search import MissingSearch
from observer_rt.desk.live_page.missing.word import SecretWord, WordResult
from observer_rt.desk.live_page.reading import Watching
from observer_rt.desk.model_steps import UnacceptedChangesError
from observer_rt.foundation.errors import ObserverError, UserError

ACCEPT = "accept-changes"  # the word of the second press
_STATUS = {WordResult.WRONG: 403, WordResult.TOO_EARLY: 429}


class MissingEffects:
    """The injectors of a bench whose evidence is kept, and the bench as its file is now."""

    def __init__(self, bench: Bench, watching: Watching, word: SecretWord, read: Callable[[], Bench]) -> None:
        """word: that whoever presses a button must know; read: the bench file anew."""
        self.word = word
        self._watching = watching
        self._read = read
        self._bench, self._stamp = bench, 0
        self._searches: Mapping[str, MissingSearch] = {
            alone.injector.name: MissingSearch(alone)
            for alone in bench.each
            if alone.injector.evidence is not None
        }

    def html(self) -> str:
        """All panels, by the models that the bench file names now."""
        if (stamp := self._bench.path.stat().st_mtime_ns) != self._stamp:
            with suppress(ObserverError):  # being written, or wrong: the daemon's log says so
                self._bench, self._stamp = self._read(), stamp
        injections = {reader.name: reader.injections() for reader in self._watching.readers}
        panels = (
            panel_html(self._bench.of(name or None), injections[name], search)
            for name, search in self._searches.items()
        )
        return "\n".join(f'<section class="panel">{html}</section>' for html in panels)

    def report(self, name: str) -> Path:
        """The report on an injector. Raises `UserError` for one without."""
        finding = self._search(name).finding
        if finding is None:
            raise UserError("report", "there is none", "search first")
        return finding.report

    async def press(self, button: str, name: str, accepts_changes: bool) -> str:
        """Do what a button asks for; what to say. Raises `ObserverError`."""
        from observer_rt.desk.take_over import take_over, undo  # much, and rarely pressed

        search, alone = self._search(name), self._bench.of(name or None)
        if button == "search":
            search.start()
            return ""
        if button == "take_over":
            finding = search.finding
            if finding is None or finding.amended is None:
                raise UserError("finding", "there is nothing to take over", "search first")
            done = await asyncio.to_thread(take_over, alone.path, name, finding.amended, accepts_changes)
            said = f"{alone.path.name} names {done.step.as_text} now"
        elif button == "undo":
            done = await asyncio.to_thread(undo, alone.path, name)
            said = f"{alone.path.name} names {done.step.before or 'the nominal injector'} again"
        else:
            raise UserError(button, "is no button of this page", "load the page anew")
        changed = "".join(f"; {change}" for change in done.changes)
        heard = "the observer has it in force" if done.has_daemon else "no observer runs to read it"
        return f"{said}{changed}; {heard}"

    def _search(self, name: str) -> MissingSearch:
        if name not in self._searches:
            raise UserError(
                name, "is no injector whose evidence is kept", "state [evidence] folder in the bench file"
            )
        return self._searches[name]


def handlers_of(
    guarded: type[RequestHandler], missing: MissingEffects
) -> list[tuple[str, type[RequestHandler]]]:
    """Handlers of its addresses. guarded: the handler that asks for the page's token first."""

    class Now(guarded):  # type: ignore[misc, valid-type]  # a class that is given
        def get(self) -> None:
            """The panels as they are now."""
            self.finish(missing.html())

    class Report(guarded):  # type: ignore[misc, valid-type]
        def get(self, name: str = "") -> None:
            """The report on an injector."""
            try:
                self.finish(missing.report(name).read_text(encoding="utf-8"))
            except (ObserverError, OSError):
                self.send_error(404)

    class Press(guarded):  # type: ignore[misc, valid-type]
        async def post(self) -> None:
            """A button was pressed: `button`, `injector`, `word`, and at a second press `accepted`."""
            origin = self.request.headers.get("Origin")
            if origin is not None and urlsplit(origin).netloc != self.request.host:
                self.set_status(403)
                self.finish("A page of another server presses no button here.")
                return
            result = missing.word.check(self.get_body_argument("word", ""), self.request.remote_ip)
            if result is not WordResult.RIGHT:
                self.set_status(_STATUS[result])
                self.finish(result.value)
                return
            accepts = self.get_body_argument("accepted", "") == ACCEPT
            try:
                self.finish(
                    await missing.press(
                        self.get_body_argument("button"), self.get_body_argument("injector", ""), accepts
                    )
                )
            except UnacceptedChangesError as error:
                self.set_status(428)
                self.finish(f"{error} by the word {ACCEPT}")
            except ObserverError as error:
                self.set_status(409)
                self.finish(str(error))

    return [("/missing/now", Now), ("/missing/report/?(.*)", Report), ("/missing/press", Press)]
