"""Normative part of `reel`: changes here change the meaning of stored streams."""
