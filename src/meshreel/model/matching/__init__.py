"""Matching of frames that differ only in the order of vertices and faces.

`corners` identifies corners by their values, `faces` aligns the faces of several segments by them,
`vertices` finds the vertices that the corners share, and `segments` joins the segments.
"""
