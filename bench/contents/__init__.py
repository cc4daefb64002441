"""Everything that files hold, listed by readers that are independent of ours.

`items` defines an item and compares lists of them. Each other module lists the contents of a family
of formats: its `EXTENSIONS` are their file extensions, and ``walk(path)`` yields an `Item` for each
value of a file. Walks read with other libraries, or parse the text themselves.
"""
