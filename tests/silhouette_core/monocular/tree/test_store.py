"""The library's file: what is read is what was written, and what is wrong is said."""

import json
import zlib
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.monocular.tree.store import is_library, read_library, write_library
from tests.silhouette_core.monocular.tree.small_library import small_library


@pytest.fixture(scope="module")
def made():
    return small_library(poses=60)


@pytest.fixture
def path(made, tmp_path):
    write_library(made, tmp_path / "me.vplib")
    return tmp_path / "me.vplib"


def test_what_is_read_is_what_was_written(made, path):
    read = read_library(path)
    assert [file.name for file in path.parent.iterdir()] == ["me.vplib"]
    assert read.settings == made.settings and read.bases.clips == made.bases.clips
    for name in ("angles", "quaternion", "source", "mirrored", "sigma_rad"):
        array, written = (getattr(one.bases, name) for one in (read, made))
        assert (array == written).all() and array.dtype == written.dtype
    for name in ("areas", "occluded", "cut", "pelvis_px", "views", "leaf_samples"):
        array = getattr(read, name)
        assert (array == getattr(made, name)).all() and array.dtype == getattr(made, name).dtype
        assert not array.flags.owndata and array.flags.writeable  # the file itself, mapped
    for one, other in zip(read.levels, made.levels, strict=True):
        assert (
            (one.parent == other.parent).all()
            and (one.spans.starts == other.spans.starts).all()
            and one.size_px == other.size_px
        )
    assert all((read.neighbours[name] == made.neighbours[name]).all() for name in made.neighbours)
    assert (read.model.vertices_m == made.model.vertices_m).all()
    assert read.model.sizes == made.model.sizes
    silhouettes = made.render(np.arange(len(made))).windows.any(axis=0)
    rows, columns = (np.flatnonzero(silhouettes.any(axis=axis)) for axis in (1, 0))
    assert read.bounds_px == (columns[0], rows[0], columns[-1] + 1, rows[-1] + 1)


def test_settings_of_earlier_files_are_understood(path, made):
    content = path.read_bytes()
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    about = json.loads(header["__metadata__"]["about"])
    assert about["settings"].pop("weighting") == "nwxor"
    about["settings"] |= {"proposal": True, "tree": "whole"}  # no choice any more
    text = json.dumps(about)
    header["__metadata__"] |= {"about": text, "about_checksum": str(zlib.crc32(text.encode()))}
    text = json.dumps(header)
    path.write_bytes(len(text).to_bytes(8, "little") + text.encode() + content[8 + length :])
    assert read_library(path).settings == replace(made.settings, weighting="xor")


@pytest.mark.parametrize("where", [0.0, 0.3, 0.6, 0.999])
def test_a_changed_byte_is_noticed(path, where):
    content = bytearray(path.read_bytes())
    body = 8 + int.from_bytes(content[:8], "little")
    place = body + int(where * (len(content) - body))
    content[place] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"me\.vplib is damaged .* changed"):
        read_library(path)


def test_a_changed_description_is_noticed(path):
    content = path.read_bytes()
    assert b"1.75" in content
    path.write_bytes(content.replace(b"1.75", b"1.65", 1))
    with pytest.raises(InputError, match="description changed"):
        read_library(path)


@pytest.mark.parametrize(
    ("keep", "line"),
    [
        (0, "empty"),
        (5, "not a pose library, or is damaged"),
        (300, "not a pose library"),
        (0.7, "truncated"),
        (-1, "trunc"),
    ],
)
def test_a_truncated_file_is_refused(path, keep, line):
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content)) if isinstance(keep, float) else keep])
    with pytest.raises(InputError, match=line):
        read_library(path)


def test_other_files_and_versions_are_refused(path, tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_library(tmp_path / "nothing")
    (tmp_path / "text").write_text("no library at all, but some text of a certain length")
    with pytest.raises(InputError, match="not a pose library"):
        read_library(tmp_path / "text")
    assert (
        is_library(path)
        and not is_library(tmp_path / "text")
        and not is_library(tmp_path / "nothing")
    )
    content = path.read_bytes()
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    header["__metadata__"]["version"] = "0"
    text = json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + content[8 + length :])
    with pytest.raises(InputError, match="version 0, and this program reads version 4"):
        read_library(path)


def test_a_library_without_poses_is_refused(made, path):
    none = np.zeros(0, np.int32)
    write_library(replace(made, sample_base=none, sample_view=none.astype(np.int16)), path)
    with pytest.raises(InputError, match="holds no poses"):
        read_library(path)
