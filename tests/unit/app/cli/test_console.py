import pytest

from meshreel.app.cli.console import PaceClock, clock_text, pace_text, print_notes
from meshreel.runtime.progress import Count


def test_note_is_printed_once_and_not_wrapped(capsys):
    note = "left out: " + ", ".join(f"field {number}" for number in range(40))
    print_notes([note, note])
    assert capsys.readouterr().err == f"note: {note}\n"


class FakeTime:
    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


def test_words_contain_count_pace_and_remaining_time():
    time = FakeTime()
    clock = PaceClock(time)
    assert clock.describe(Count(5, 175, "frames")) == "5 of 175 frames"
    time.now_s += 10
    assert clock.describe(Count(85, 175, "frames")) == "85 of 175 frames, 8 frames/s, 0:11 left"


def test_words_contain_no_pace_at_the_beginning():
    time = FakeTime()
    clock = PaceClock(time)
    clock.describe(Count(0, 9, "inputs"))
    time.now_s += 1
    assert clock.describe(Count(4, 9, "inputs")) == "4 of 9 inputs"


def test_pace_restarts_when_the_unit_or_total_changes_or_the_count_falls():
    time = FakeTime()
    clock = PaceClock(time)
    for count in (Count(0, 10, "frames"), Count(10, 10, "frames"), Count(1, 10, "frames")):
        time.now_s += 50
        words = clock.describe(count)
    assert words == "1 of 10 frames"
    time.now_s += 4
    assert clock.describe(Count(3, 10, "frames")) == "3 of 10 frames, 2 s each, 0:14 left"
    assert clock.describe(Count(3, 20, "runs")) == "3 of 20 runs"


def test_words_are_empty_when_nothing_is_counted():
    assert PaceClock().describe(0.5) == ""


@pytest.mark.parametrize(
    ("per_second", "text"), [(8.44, "8.44 frames/s"), (1.0, "1 frame/s"), (0.25, "4 s each")]
)
def test_pace_below_one_is_stated_per_item(per_second, text):
    assert pace_text(per_second, "frames") == text


@pytest.mark.parametrize(("seconds", "text"), [(0, "0:00"), (79.6, "1:20"), (11220, "3:07:00")])
def test_clock_text_has_hours_only_when_there_are_any(seconds, text):
    assert clock_text(seconds) == text
