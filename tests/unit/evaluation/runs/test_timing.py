from meshreel.evaluation.runs import timing


def test_short_work_is_timed_repeatedly_on_request():
    value, seconds = timing.timed(lambda: 5, 3)
    assert value == 5
    assert len(seconds) == 3


def test_long_work_is_timed_once(monkeypatch):
    monkeypatch.setattr(timing, "REPEAT_BELOW_S", 0.0)
    assert len(timing.timed(lambda: 5, 3)[1]) == 1
