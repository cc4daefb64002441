"""Our codec beside other codecs: `meshreel evaluate`."""
