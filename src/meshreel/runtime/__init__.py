"""How work is done, whatever the work is.

`threads` runs array work on all cores, `engine` independent calls on processes or on a cluster.
`progress` reports how far work is, `profiling` where its time goes, and `outputs` writes files that
appear whole or not at all.
"""
