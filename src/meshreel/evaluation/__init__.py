"""Evaluations of codecs on sequences, with reports.

`pipeline` executes a study: it runs what the study plans and stores the results (`runs/`), draws
its plots (`plots/`) and writes its document as Markdown and HTML (`report`). There are three
studies: `codecs/` compares our codec with others, `tracks/` compares a track with compressors of
arrays, and `meshreel.paper.study` runs the paper's evaluation. Each has modules for settings,
measurements, results and the document, and a `study` that connects them to the pipeline.
"""
