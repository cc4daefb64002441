"""The player: the data that its page asks for, a server for it, and pages that need none."""
