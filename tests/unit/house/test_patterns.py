"""Regular expressions mean the same on every Python that the project runs on."""

from __future__ import annotations

import ast
import re

from tests.source_tree import modules

OF_A_GROUP = re.compile(r"(?<!\\)\)(?:[*+?]|\{[0-9{},]*\})\+")


def test_no_group_is_repeated_possessively():
    """Python up to 3.11.4 keeps what a repetition of a group took before it failed half way (CPython issue 106052)."""
    assert OF_A_GROUP.search(r"(?:,a)*+") and OF_A_GROUP.search("(a){2}+") and not OF_A_GROUP.search(r"\)++(?>(a)*)")
    texts = [(name, node) for name, tree in modules() for node in ast.walk(tree)
             if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    assert [f"{name}:{node.lineno}" for name, node in texts if OF_A_GROUP.search(node.value)] == []
