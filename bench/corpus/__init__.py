"""Public sequences of many kinds: where they are, and what codecs need for them."""
