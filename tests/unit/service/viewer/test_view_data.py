"""What the file of a page says beside the picture."""

from service.viewer.view_data import _minded


def test_what_is_to_be_minded_is_told_once():
    caution = {"kind": "deflection", "message": "tool T1: its tip would bend", "remedy": "a shorter one does not",
               "subjects": ["T1"], "at_mm": None, "measured": 0.1, "limit": 0.05}
    report = {"warnings": [caution], "proof": {"notes": ["travel was not held against the machine's"]},
              "part": {"warnings": ["two faces overlap", "tool T1: its tip would bend; a shorter one does not"]}}
    said = _minded(report)
    assert said["notes"] == ["two faces overlap", "travel was not held against the machine's"]
    assert [c["message"] for c in said["cautions"]] == ["tool T1: its tip would bend"]
    # a verification has no cautions of its own
    assert _minded({k: report[k] for k in ("proof", "part")})["cautions"] == []
