"""An engine that runs calls in the caller, for tests."""

from concurrent.futures import Future


class InlineWorkers:
    """Runs every call on submission, and records it."""

    n_workers = 1

    def __init__(self):
        self.calls = []

    def submit(self, function, /, *args):
        self.calls.append(args)
        outcome: Future[object] = Future()
        try:
            outcome.set_result(function(*args))
        except Exception as error:
            outcome.set_exception(error)
        return outcome

    def submit_elsewhere(self, error, function, /, *args):
        return self.submit(function, *args)

    def close(self, *, at_once):
        pass
