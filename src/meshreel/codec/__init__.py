"""The method: sequences to streams and back."""
