"""The player: what its page asks for, a server for it, and pages that need none."""
