"""A live session in a process of its own: it is told what to do, and tells how it goes."""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict
from typing import Any

from calib.errors import InputError
from voxelpose.cli.live import Live
from voxelpose.live.live_page import Page, controls_of
from voxelpose.live.senders import Senders
from voxelpose.live.session import LiveSession
from voxelpose.view.serving.gate import Address
from voxelpose.view.serving.page_job import JobReporter

SEND_TO = "send to"
"""Before a word for the job: the receivers, a line each, that take the place of the others."""
_LOOK_MS = 100
_TOLD_EVERY_MS = 400


def follow(reporter: JobReporter, command: Live, title: str, token: str) -> dict[str, Any]:
    """Runs a session until it is asked to "finish", or to the end of the videos that stand for
    cameras; returns the number of `frames` and of those that were `dropped`. Its page is served to
    this machine alone, to who knows the token, at the `port` that it tells. InputError where a
    user can correct something.
    """
    session = command.prepare(reporter)
    with ExitStack() as parts:
        parts.callback(session.close)
        receivers = _Receivers(command.send)
        parts.callback(lambda: receivers.now.close())
        session.receivers.append(lambda frame: receivers.now.send(frame))
        address = Address("127.0.0.1", 0, token)
        cameras, people = session.settings.rig.cameras, session.settings.people
        page = Page(session, cameras, address, lambda: receivers.now.states, title, people)
        parts.callback(page.close)
        session.receivers.append(page.show)
        reporter.tell(port=page.port)
        _run(reporter, session, receivers)
    return {"frames": session.state.frames, "dropped": session.state.dropped}


class _Receivers:
    """The receivers of a session, those that there are `now`: they may be exchanged."""

    def __init__(self, addresses: Sequence[str]) -> None:
        """InputError where an address is wrong."""
        self.now = Senders(addresses)

    def exchange(self, addresses: Sequence[str]) -> None:
        """Sends to others from now on. InputError where an address is wrong: the old ones stay."""
        old, self.now = self.now, Senders(addresses)
        old.close()


def _run(reporter: JobReporter, session: LiveSession, receivers: _Receivers) -> None:
    controls = controls_of(session)
    reporter.stage("live session")
    session.start_cameras()
    if session.state.phase == "no background":
        session.learn_background()
    told_s, trouble = 0.0, ""
    while not session.wait(_LOOK_MS / 1000):
        asked = reporter.asked()
        if asked == "finish":
            return
        if asked is not None and asked.startswith(SEND_TO):
            trouble = ""
            try:
                receivers.exchange(asked.removeprefix(SEND_TO).split())
            except InputError as error:
                trouble = str(error)
        elif asked in controls:
            controls[asked]()
        if asked is not None or 1000 * (time.monotonic() - told_s) > _TOLD_EVERY_MS:
            told_s = time.monotonic()
            state, links = session.state, [asdict(one) for one in receivers.now.states]
            reporter.tell(**asdict(state), pace=state.pace, receivers=links, trouble=trouble)
