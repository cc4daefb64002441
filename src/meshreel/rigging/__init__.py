"""Rigs: bones, weights and correctives fitted to an animation."""
