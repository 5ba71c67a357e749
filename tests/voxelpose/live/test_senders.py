"""Sending to real sockets: receivers that listen, are absent, slow, refuse or close."""

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import pytest
from oscpy.parser import read_packet
from websockets.sync.server import Server, ServerConnection, serve

from calib.errors import InputError
from tests.voxelpose.live import sessions
from tests.voxelpose.live.live_scenes import bare_frame, posed
from voxelpose.live.senders import Senders, parse_receiver

BODY = posed({"left_forearm.flexion": 40.0})
wait_until = partial(sessions.wait_until, seconds=8.0)


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def sending(*addresses: str) -> Iterator[Senders]:
    """Senders that leave no thread behind."""
    before = set(threading.enumerate())
    senders = Senders(addresses)
    try:
        yield senders
    finally:
        began = time.monotonic()
        senders.close()
        assert time.monotonic() - began < 2.0
        new = set(threading.enumerate()) - before
        assert not [thread for thread in new if thread.name.startswith("send to")]


@contextmanager
def receiver(
    handle: Callable[[ServerConnection], None], port: int = 0, **options
) -> Iterator[tuple[Server, str]]:
    """A WebSocket server of the websockets package, and its address."""
    with serve(handle, "127.0.0.1", port, **options) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server, f"ws://127.0.0.1:{server.socket.getsockname()[1]}/pose?take=1"
        finally:
            server.shutdown()
            thread.join()


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("vmc://127.0.0.1:39540", "127.0.0.1", 39540),
        ("vmc://studio", "studio", 39539),
        ("vmc://[::1]:5000/", "::1", 5000),
        (" ws://127.0.0.1:8765/path?a=b ", "127.0.0.1", 8765),
    ],
)
def test_addresses(text, host, port):
    found = parse_receiver(text)
    assert (found.host, found.port, found.protocol) == (host, port, text.strip().split(":")[0])


def test_a_token_in_an_address_is_not_shown():
    with sending("ws://127.0.0.1:9/path?token=secret") as senders:
        (state,) = senders.states
    assert state.address == "ws://127.0.0.1:9/path?…"
    with pytest.raises(InputError) as error:
        Senders(["ws://no.such.host.invalid:9/?token=secret"])
    assert "secret" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("127.0.0.1", "protocol"),
        ("osc://127.0.0.1:1", "osc://"),
        ("wss://127.0.0.1:1", "wss://"),
        ("ws://127.0.0.1/pose", "port"),
        ("vmc://:39539", "host"),
        ("vmc://127.0.0.1:99999", "range"),
        ("vmc://127.0.0.1:port", "port"),
        ("vmc://127.0.0.1:39539/avatar", "paths"),
        ("ws://me:secret@127.0.0.1:1", "user name"),
        ("ws://[::1:80", "IPv6"),
        ("", "protocol"),
    ],
)
def test_a_wrong_address_is_one_line(text, word):
    with pytest.raises(InputError, match=word) as caught:
        Senders([text])
    message = str(caught.value)
    assert message.startswith("--send") and "write vmc://" in message and "\n" not in message


def test_people_need_a_port_each():
    assert parse_receiver("vmc://127.0.0.1:65534", 2).port == 65534
    with pytest.raises(InputError, match="2 people need 2 ports: give 65534 at most"):
        parse_receiver("vmc://127.0.0.1:65535", 2)
    assert parse_receiver("ws://127.0.0.1:65535", 2).port == 65535


def test_an_unknown_host_is_one_line_and_leaves_no_thread():
    with pytest.raises(InputError, match=r"knows no host 'nowhere\.invalid'"):
        Senders(["vmc://127.0.0.1:9", "vmc://nowhere.invalid:39539"])
    assert not [t for t in threading.enumerate() if t.name.startswith("send to")]


def test_two_receivers_at_once():
    lines: list[dict] = []
    paths: list[str] = []

    def take(link: ServerConnection) -> None:
        assert link.request is not None
        paths.append(link.request.path)
        lines.extend(json.loads(line) for line in link)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as avatar, receiver(take) as (_, url):
        avatar.bind(("127.0.0.1", 0))
        avatar.settimeout(5)
        with sending(f"vmc://127.0.0.1:{avatar.getsockname()[1]}", url) as senders:
            wait_until(lambda: senders.states[1].working)
            for number in range(5):
                senders.send(bare_frame(number, BODY))
                wait_until(lambda n=number: all(state.sent > n for state in senders.states))
            states = senders.states
            bones, times = 0, []
            while len(times) < 5:
                for address, _, values, _ in read_packet(avatar.recv(2048), encoding="utf8"):
                    bones += address == b"/VMC/Ext/Bone/Pos" or address == "/VMC/Ext/Bone/Pos"
                    if "Ext/T" in str(address):
                        times.append(values[0])
            wait_until(lambda: len(lines) == 5)
    assert bones == 5 * 22 and times == pytest.approx([k / 25 for k in range(5)])
    assert [line["number"] for line in lines] == list(range(5)) and paths == ["/pose?take=1"]
    for state in states:
        assert (state.message, state.working, state.sent, state.dropped) == ("sending", True, 5, 0)
        assert 0 < state.send_s < 5


def test_of_several_people_each_moves_an_avatar_of_its_own():
    """Person 2's bones go to the next port; of the lines of JSON each tells whose it is."""
    lines: list[dict] = []

    def take(link: ServerConnection) -> None:
        lines.extend(json.loads(line) for line in link)

    with (
        receiver(take) as (_, url),
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second,
    ):
        first.bind(("127.0.0.1", 0))
        port = first.getsockname()[1]
        second.bind(("127.0.0.1", port + 1))
        with sending(f"vmc://127.0.0.1:{port}", url) as senders:
            senders.send(replace(bare_frame(1), people=(None, BODY)))
            wait_until(lambda: len(lines) == 2 and senders.states[0].sent == 1)
        sizes = []
        for avatar in (first, second):
            avatar.settimeout(5)
            sizes.append(len(avatar.recv(2048)))
    assert sizes[0] < 200 < 1000 < sizes[1]  # without bones, and with them
    assert [(line["person"], line["body"] is None) for line in lines] == [(1, True), (2, False)]


def test_absent_receivers_delay_nobody_and_are_found_later():
    port, udp_port = free_port(), free_port(socket.SOCK_DGRAM)
    got: list[int] = []

    def take(link: ServerConnection) -> None:
        got.extend(json.loads(line)["number"] for line in link)

    with sending(f"ws://127.0.0.1:{port}", f"vmc://127.0.0.1:{udp_port}") as senders:
        began = time.perf_counter()
        for number in range(100):
            senders.send(bare_frame(number, BODY))
        assert time.perf_counter() - began < 5  # a single connection attempt may take as long
        wait_until(lambda: "nobody listens there, trying again in" in senders.states[0].message)
        assert not senders.states[0].working and senders.states[0].sent == 0
        wait_until(lambda: senders.states[0].dropped >= 98)

        def both(number: int) -> None:
            senders.send(bare_frame(number, BODY))
            time.sleep(0.02)

        wait_until(lambda: (both(1), "sending all the same" in senders.states[1].message)[1])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as avatar, receiver(take, port):
            avatar.bind(("127.0.0.1", udp_port))
            wait_until(lambda: (both(7), all(state.working for state in senders.states))[1])
            wait_until(lambda: bool(got))
            assert avatar.recv(2048).startswith(b"#bundle")


def test_a_slow_receiver_gets_the_newest_frame():
    """It reads nothing for a while: what had piled up is then at most one frame, and the newest."""
    go_on, got = threading.Event(), []

    def take(link: ServerConnection) -> None:
        got.append(json.loads(link.recv())["number"])
        go_on.wait(10)
        got.extend(json.loads(line)["number"] for line in link)

    # A queue of one frame: the server reads no pings while its reader is busy.
    with receiver(take, max_queue=1) as (_, url), sending(url) as senders:
        wait_until(lambda: senders.states[0].working)
        senders.send(bare_frame(0, BODY))
        wait_until(lambda: got == [0])
        for number in range(1, 200):
            senders.send(bare_frame(number, BODY))
            time.sleep(0.002)
        wait_until(lambda: senders.states[0].dropped > 100)
        go_on.set()
        wait_until(lambda: got[-1] == 199)
        assert len(got) < 30 and got == sorted(got)


def test_closing_and_refusing_receivers_are_tried_again():
    visits: list[int] = []

    def leave(link: ServerConnection) -> None:
        visits.append(json.loads(link.recv())["number"])
        link.close(1001, "lunch")

    def refuse(link: ServerConnection, request):
        return link.respond(403, "no\n")

    with (
        receiver(leave) as (_, url),
        receiver(leave, process_request=refuse) as (_, shut),
        sending(url, shut) as senders,
    ):

        def go_on(done: Callable[[], bool]) -> None:
            wait_until(lambda: (senders.send(bare_frame(4, BODY)), time.sleep(0.02), done())[2])

        go_on(lambda: "it closed the connection (lunch), trying" in senders.states[0].message)
        go_on(lambda: "refused the connection (HTTP 403)" in senders.states[1].message)
        go_on(lambda: len(visits) >= 2)
        assert senders.states[1].sent == 0


def test_a_receiver_that_never_answers_is_closed_at_once():
    with socket.create_server(("127.0.0.1", 0)) as silent:  # accepts, and says nothing
        with sending(f"ws://127.0.0.1:{silent.getsockname()[1]}") as senders:
            senders.send(bare_frame(1, BODY))
            time.sleep(0.2)
            assert not senders.states[0].working
        senders.send(bare_frame(2, BODY))  # after the end: nothing happens
        assert senders.states[0].message == "closed"


def test_what_a_receiver_says_is_ignored():
    got: list[int] = []

    def chat(link: ServerConnection) -> None:
        for line in link:
            got.append(json.loads(line)["number"])
            for _ in range(40):  # more than any queue holds
                link.send("hello")

    with receiver(chat) as (_, url), sending(url) as senders:
        wait_until(lambda: senders.states[0].working)
        for number in range(4):
            senders.send(bare_frame(number, BODY))
            wait_until(lambda n=number: got[-1:] == [n])


def test_a_receiver_that_stops_reading_is_given_up(monkeypatch):
    monkeypatch.setattr("voxelpose.live.senders._SILENT_S", 0.3)
    go_on = threading.Event()
    with receiver(lambda _: bool(go_on.wait(10)), max_queue=1) as (_, url), sending(url) as senders:
        wait_until(lambda: senders.states[0].working)
        for number in range(3):  # more than its queue holds
            senders.send(bare_frame(number, BODY))
            time.sleep(0.05)
        wait_until(lambda: senders.states[0].message.startswith("no answer, trying again in"))
        go_on.set()
