import pytest

from calib.errors import InputError
from calib.storage.documents import (
    csv_rows,
    load_text,
    parse_json,
    parse_toml,
    parse_xml,
    visible_entries,
)


def test_text_is_bounded_and_decoded(tmp_path):
    path = tmp_path / "file.txt"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\n")
    assert load_text(path, 10) == "a\nb\n"
    with pytest.raises(InputError, match=r"file\.txt is larger than the .* MB"):
        load_text(path, 7)
    path.write_bytes(b"ab\xff")
    with pytest.raises(InputError, match=r"file\.txt is not a text file \(byte 2 is no UTF-8\)"):
        load_text(path, 10)
    with pytest.raises(InputError, match="cannot be read: No such file"):
        load_text(tmp_path / "none", 10)


@pytest.mark.parametrize(
    ("parse", "text"),
    [
        (parse_json, "[" * 60 + "]" * 60),
        (parse_json, "[" * 100_000 + "]" * 100_000),
        (parse_toml, "a = " + "[" * 60 + "]" * 60),
        (parse_toml, "a = " + "[" * 5_000 + "]" * 5_000),
        (parse_xml, "<a>" * 60 + "</a>" * 60),
        (parse_xml, "<a>" * 300_000),
    ],
)
def test_deep_nesting_is_refused(tmp_path, parse, text):
    with pytest.raises(InputError, match="nested more than 50 levels deep"):
        parse(text, tmp_path / "deep")


def test_numbers_of_thousands_of_digits_are_no_traceback(tmp_path):
    digits = "9" * 5_000
    assert parse_json(f"[{digits}, -{digits}, 12]", tmp_path) == [float("inf"), -float("inf"), 12]
    with pytest.raises(InputError, match="no valid TOML: Exceeds the limit"):
        parse_toml(f"a = {digits}", tmp_path)


def test_xml_with_entities_is_refused(tmp_path):
    bomb = '<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c "&b;&b;">]><a>&c;</a>'
    with pytest.raises(InputError, match=r"has a document type \(<!DOCTYPE a>\)"):
        parse_xml(bomb, tmp_path)
    assert parse_xml("<?xml version='1.0' encoding='ASCII'?><a>é</a>", tmp_path).text == "é"


@pytest.mark.parametrize(
    ("parse", "text", "message"),
    [
        (parse_json, "{", "broken JSON"),
        (parse_toml, "a = [", "no valid TOML"),
        (parse_xml, "<a><b></a>", "broken XML"),
    ],
)
def test_what_is_broken_is_named_with_its_file(tmp_path, parse, text, message):
    with pytest.raises(InputError, match=message) as caught:
        parse(text, tmp_path / "file")
    assert str(tmp_path / "file") in str(caught.value)


def test_rows_of_a_table_hold_what_is_asked_for(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("a,b,c\n1,2,3\n\n4\n5,6,7,\n", encoding="utf-8-sig")
    assert list(csv_rows(path, ("a",), 100, optional=("c", "d"))) == [
        {"a": "1", "c": "3"},
        {"a": "4"},
        {"a": "5", "c": "7"},
    ]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no column a, b: its first line must name a,b"),
        (b"a\n1\n", "no column b"),
        (b"a;b\n1;2\n", "separated by semicolons: .* with a point"),
        (b"a\tb\n1\t2\n", "separated by tabs"),
        (b"a,b\n1,5,2\n", "line 2 has more columns than the first: .* with a point"),
        ("a,b\n1,2\n".encode("utf-16"), "UTF-16: save it as UTF-8"),
        ("a,b\n1,2\n".encode("utf-16-le"), "UTF-16"),
        (b'a,b\n"' + b"1,2\n" * 50_000, "field larger than field limit .*a stray quote"),
        (b"a,b\n1,\xff\n", "cannot be read as CSV"),
        (b"a,b\n" + b"1,2\n" * 100_000, "larger than the 0 MB"),
    ],
)
def test_a_damaged_table_is_one_line(tmp_path, content, message):
    (tmp_path / "t.csv").write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        list(csv_rows(tmp_path / "t.csv", ("a", "b"), 300_000))
    assert "t.csv" in str(caught.value) and "\n" not in str(caught.value)


def test_hidden_and_unfinished_entries_are_left_out(tmp_path):
    for name in ("walk", "._walk", "walk.partial-12-0123abcd", "walk.old-12-0123abcd", "a.partial"):
        (tmp_path / name).mkdir()
    assert [path.name for path in visible_entries(tmp_path)] == ["a.partial", "walk"]
    assert visible_entries(tmp_path / "none") == []
