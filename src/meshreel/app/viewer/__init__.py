"""The player: the data of its page, a server, and pages that need no server."""
