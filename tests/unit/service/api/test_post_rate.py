"""How many jobs a principal may post, by a clock that nobody sets."""

import time

import pytest

from service.api.principals import PostRate
from service.errors import RateError


def test_so_many_in_any_window_and_each_principal_for_himself(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    rate = PostRate("3/minute")
    for _ in range(3):
        rate.check("ada")
        now[0] += 10
    with pytest.raises(RateError) as refused:
        rate.check("ada")
    assert refused.value.retry_after_s == 30
    rate.check("bob")
    now[0] += 30
    rate.check("ada")  # the first is a minute old
    with pytest.raises(RateError) as refused:
        rate.check("ada")
    assert refused.value.retry_after_s == 10


def test_a_clock_that_is_set_back_refuses_nothing(monkeypatch):
    true, back = time.time, 0.0
    monkeypatch.setattr(time, "time", lambda: true() - back)
    rate = PostRate("2/second")
    rate.check("mes")
    rate.check("mes")
    back = 3600.0
    time.sleep(1.1)
    rate.check("mes")
