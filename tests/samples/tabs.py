"""Browser pages reused by tests: opening one takes longer than most tests."""

from collections import defaultdict


class Tab:
    """A page, and its errors.

    Parameters
    ----------
    browser
        One of playwright.
    script : str
        Runs before those of the page.
    routes : dict of str to bytes, str or None
        What is answered at addresses; None: as if no server were there.
    is_webgl_watched : bool
        Whether what WebGL complains of is an error.
    """

    def __init__(self, browser, script, routes, is_webgl_watched):
        self.errors, self.is_gone = [], False
        self.context = browser.new_context()
        self.page = self.context.new_page()
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        if is_webgl_watched:
            self.page.on("console", lambda said: self.errors.extend(_webgl_errors(said.text)))
        self.page.on("crash", lambda _: setattr(self, "is_gone", True))
        self.page.add_init_script(script)
        for pattern, body in routes.items():
            self.page.route(pattern, _answering(body))

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

    Two that have another script or other routes are never the same.
    """

    def __init__(self, browser, *, is_webgl_watched=True):
        self.browser, self.is_webgl_watched = browser, is_webgl_watched
        self.free, self.taken = defaultdict(list), []

    def take(self, script="", routes=None):
        """Return an empty page."""
        kind = (script, tuple((routes or {}).items()))
        made = (self.browser, script, routes or {}, self.is_webgl_watched)
        tab = self.free[kind].pop() if self.free[kind] else Tab(*made)
        self.taken.append((kind, tab))
        return tab.page

    def give_back(self):
        """Return the errors of the lent pages; without errors the pages become available again."""
        taken, self.taken = self.taken, []
        for kind, tab in taken:
            if tab.is_cleared():
                self.free[kind].append(tab)
        return [error for _, tab in taken for error in tab.errors]


def _webgl_errors(text):
    return [text] if "WebGL: INVALID" in text else []


def _answering(body):
    return lambda route: route.abort() if body is None else route.fulfill(body=body)
