"""An engine that works in the caller, for tests of what is done with one."""

from concurrent.futures import Future


class InlineWorkers:
    """Does every call when it is submitted, and remembers it."""

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
