"""The framework of studies: runs on sequences, and reports of their results.

A study plans runs for a sequence, and turns their results into tables and pictures (`study`).
Results are stored and reused (`runs`). `meshreel evaluate` (`meshreel.evaluation`), `meshreel
paper` (`meshreel.paper.study`) and scripts in `bench/` are studies.
"""
