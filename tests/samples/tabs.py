"""Browser pages reused by tests: opening one takes longer than most tests."""

from collections import defaultdict


class Tab:
    """A page and its errors.

    Parameters
    ----------
    browser
        From playwright.
    script : str
        Runs before the scripts of the page.
    routes : dict of str to bytes, str or None
        Answers by address; None simulates a missing server.
    is_webgl_watched : bool
        Whether WebGL warnings are errors.
    """

    def __init__(self, browser, script, routes, is_webgl_watched):
        self.errors, self.is_gone = [], False
        self.context = browser.new_context()
        self.page = self.context.new_page()
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        if is_webgl_watched:
            self.page.on("console", lambda message: self.errors.extend(_webgl_errors(message.text)))
        self.page.on("crash", lambda _: setattr(self, "is_gone", True))
        self.page.add_init_script(script)
        for pattern, body in routes.items():
            self.page.route(pattern, _answer_with(body))

    def is_cleared(self):
        """Clear the page for reuse, and stop its workers and sound; close it after errors."""
        if not (self.is_gone or self.page.is_closed()):
            self.page.mouse.move(0, 0)
            self.page.emulate_media(reduced_motion="null", color_scheme="null")
            self.page.goto("about:blank")
            if not self.errors:
                return True
        self.context.close()
        return False


class Tabs:
    """Tabs of a browser, lent to tests in turn.

    Tabs are reused only with the same script and routes.
    """

    def __init__(self, browser, *, is_webgl_watched=True):
        self.browser, self.is_webgl_watched = browser, is_webgl_watched
        self.free, self.lent = defaultdict(list), []

    def take(self, script="", routes=None):
        """Return an empty page."""
        kind = (script, tuple((routes or {}).items()))
        arguments = (self.browser, script, routes or {}, self.is_webgl_watched)
        tab = self.free[kind].pop() if self.free[kind] else Tab(*arguments)
        self.lent.append((kind, tab))
        return tab.page

    def give_back(self):
        """Return the errors of the lent pages; without errors the pages become available again."""
        lent, self.lent = self.lent, []
        for kind, tab in lent:
            if tab.is_cleared():
                self.free[kind].append(tab)
        return [error for _, tab in lent for error in tab.errors]


def _webgl_errors(text):
    return [text] if "WebGL: INVALID" in text else []


def _answer_with(body):
    return lambda route: route.abort() if body is None else route.fulfill(body=body)
