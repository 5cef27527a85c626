"""The file of the page: columns come back as they went in, and what does not fit is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from geometry.errors import InternalError
from service.viewer.view_file import MAGIC, Chunk, Column, read_view, write_view

WHOLE = arrays(np.int64, st.tuples(st.integers(0, 40), st.integers(1, 3)), elements=st.integers(-2**29, 2**29))


@settings(max_examples=60, deadline=None)
@given(WHOLE, WHOLE)
def test_every_form_reads_back(one, two):
    columns = {"steps": Column(one, 4, "steps"), "signed": Column(two, 4, "signed"), "plain": Column(abs(two), 4)}
    head, chunks = read_view(write_view({"a": [1, "ü"]}, [Chunk("path", {"step": 1}, columns)]))
    assert head["a"] == [1, "ü"] and head["chunks"][0]["kind"] == "path" and head["chunks"][0]["step"] == 1
    for name, values in (("steps", one), ("signed", two), ("plain", abs(two))):
        assert np.array_equal(chunks[0][name], values)


def test_widths_hold_what_they_say_and_no_more():
    for width, most in ((1, 255), (2, 65_535), (4, 2**32 - 1)):
        _, (back,) = read_view(write_view({}, [Chunk("x", {}, {"v": Column(np.array([0, most]), width)})]))
        assert back["v"].tolist() == [[0], [most]]
        with pytest.raises(InternalError) as refused:
            Column(np.array([most + 1]), width).planes("v")
        assert refused.value.code == "view_width" and refused.value.subjects == ("v",)
    with pytest.raises(InternalError):
        Column(np.array([-1]), 4).planes("v")


def test_bytes_as_described():
    # 1, -1 as steps from 0: 1, -2, zigzag 2, 3; two planes of two bytes
    assert Column(np.array([1, -1]), 2, "steps").planes("v") == bytes([2, 3, 0, 0])
    assert Column(np.array([[0x0102, 0x0304]]), 2).planes("v") == bytes([2, 1, 4, 3])
    assert write_view({}, [])[:8] == MAGIC == b"ZMVIEW1\n"


def test_what_is_no_view_or_cut_off_is_refused():
    whole = write_view({}, [Chunk("x", {}, {"v": Column(np.arange(1000), 4)})])
    for data in (b"", b"PNG" * 10, whole[:-1]):
        with pytest.raises(ValueError):
            read_view(data)


def test_the_same_gives_the_same_bytes():
    def made():
        return write_view({"b": 1, "a": 2}, [Chunk("x", {"lod": 0}, {"v": Column(np.arange(9), 1)})])

    assert made() == made()
