"""A page's table of functions: what they are asked with, and how what they return is sent."""

from collections.abc import Iterator
from typing import Literal

import pytest
from msgspec import Struct

from calib.errors import InputError
from tests.voxelpose.setup_page.setup_scenes import ask
from voxelpose.view.serving.gate import Address, GatedServer
from voxelpose.view.serving.page_answers import Moment, PageAnswers, event_stream, file_to_keep


class Whole(Struct, forbid_unknown_fields=True):
    """What is sent as one object."""

    number: int


def frame(name: str, moment: Moment, kind: Literal["a", "b"] = "a") -> dict:
    if moment == 7:
        raise InputError("there is no moment\n7")
    return {"name": name, "moment": moment, "kind": kind}


@pytest.fixture(scope="module")
def server(tmp_path_factory) -> Iterator[GatedServer]:
    def fail() -> None:
        raise RuntimeError("a secret")

    def doubled(asked: Whole) -> dict:
        return {"twice": 2 * asked.number}

    def join(first: str, second: str = "z") -> dict:
        return {"joined": first + second}

    path = tmp_path_factory.mktemp("kept") / "a.zip"
    path.write_bytes(300_000 * b"z")
    page = PageAnswers(
        "voxelpose.studio",
        {
            "": lambda: "<html>",
            "frame/{name}": frame,
            "png": lambda: b"\x89PNG",
            "fail": fail,
            "kept": lambda: file_to_keep(path, "ä.zip", "nothing"),
            "gone": lambda: file_to_keep(path.parent / "b", "b", "nothing is there"),
            "events": lambda: event_stream(iter([{"a": 1}, None, {"b": 2}]), 1),
        },
        {"doubled": doubled, "join": join, "nothing": lambda: None},
    )
    server = GatedServer(Address("127.0.0.1", 0), page.answer, lambda: None, 1000)
    yield server
    server.close()


def test_arguments_are_the_paths_parts_and_the_query(server):
    expected = {"name": "a b", "moment": 3, "kind": "a"}
    assert ask(server, "/frame/a%20b?moment=3&more=1") == (200, expected)
    assert ask(server, "/frame/x?moment=3&kind=b&name=y")[1]["name"] == "x"
    for query in ("", "?moment=x", "?moment=-1", "?moment=3&kind=c"):
        status, content = ask(server, f"/frame/x{query}")
        assert status == 400 and "not understood" in content["error"]
    assert ask(server, "/frame/x?moment=7") == (400, {"error": "there is no moment 7", "field": ""})


def test_what_is_posted_is_the_only_argument_or_all_of_them(server):
    assert ask(server, "/doubled", {"number": 4}) == (200, {"twice": 8})
    assert ask(server, "/join", {"first": "x"}) == (200, {"joined": "xz"})
    assert ask(server, "/nothing", {}) == (200, {})
    for path, body in (
        ("/doubled", {"number": "4"}),
        ("/join", {}),
        ("/join", {"first": "x", "third": "y"}),
        ("/nothing", {"first": "x"}),
        ("/join", b"[" * 900),
    ):
        status, content = ask(server, path, body)
        assert status == 400 and "not understood" in content["error"]


def test_each_kind_of_answer_is_sent_as_it_is(server, capfd):
    assert ask(server, "/") == (200, b"<html>")
    assert ask(server, "/png") == (200, b"\x89PNG")
    assert ask(server, "/events") == (200, b'data: {"a":1}\n\ndata: {"b":2}\n\n')
    assert ask(server, "/kept") == (200, 300_000 * b"z")
    assert ask(server, "/gone") == (400, {"error": "nothing is there", "field": ""})
    assert ask(server, "/studio.css")[0] == 200
    for path, body in (("/frame", None), ("/frame/x/y", None), ("/png", {}), ("/doubled", None)):
        assert ask(server, path, body) == (404, {"error": "this is not there", "field": ""})
    status, content = ask(server, "/fail")
    assert status == 500 and "secret" not in content["error"]
    assert "RuntimeError: a secret" in capfd.readouterr().err
