"""An executor that runs calls in the caller, for tests."""

from concurrent.futures import Executor, Future


class InlineExecutor(Executor):
    """Runs every call on submission, and records it."""

    def __init__(self):
        self.calls = []

    def submit(self, function, /, *args):  # type: ignore[override]
        self.calls.append(args)
        outcome: Future[object] = Future()
        try:
            outcome.set_result(function(*args))
        except Exception as error:
            outcome.set_exception(error)
        return outcome
