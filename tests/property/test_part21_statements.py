"""Statements of Part 21 that are read at once have the values that the tokenizer finds in them."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st

from verify.stepnc.part21 import _SIMPLE, _plain_values, _Tokens

plain = st.one_of(
    st.integers(1, 10**6).map(lambda n: f"#{n}"),
    st.floats(-1e6, 1e6, allow_nan=False).map(lambda v: f"{v:.4f}"), st.sampled_from(["1.E5", "-0.", "+3.25E-2"]),
    st.sampled_from(["$", "*", ".T.", ".CONNECT.", ".LEFT_2."]),
    st.text("AZaz09 .;:-_/#$*", max_size=8).map(lambda text: f"'{text}'"))
lists = st.lists(plain, max_size=5).map(lambda values: f"({','.join(values)})")
statements = st.lists(st.one_of(plain, lists), min_size=1, max_size=6).map(lambda v: f"ANY_ENTITY({','.join(v)});")


def both(text):
    found = _SIMPLE.match(text)
    assert found is not None and found.end() == len(text)
    return [(found.group(1), _plain_values(found.group(2)))], _Tokens(text[:-1]).records()


@given(statements)
@example("A(());")
@example("A('',(),('',''),'');")
def test_the_quick_way_reads_what_the_tokenizer_reads(text):
    quick, slow = both(text)
    assert quick == slow and repr(quick) == repr(slow)


@given(st.sampled_from(["A((#1,(#2)),$);", "A(3);", "A('a''b');", "A(NAME(.T.));", "A( #1);", "A(#1,);", "A((,));",
                        "A('\\\\X\\\\41');", "A('a(b');"]))
def test_what_the_quick_way_does_not_know_is_left_to_the_tokenizer(text):
    assert _SIMPLE.match(text) is None
