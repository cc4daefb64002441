"""Evaluations: sequences in, a report out.

`pipeline` goes the whole way: the runs that a study plans (`runs/`), their results on disk, its
plots and pictures (`plots/`), its document as Markdown and HTML (`report/`). There are three
studies: `paper/` runs the paper's evaluation, `codecs/` sets our codec beside others, `tracks/` a
track beside compressors of arrays. Each has the same rooms: settings, measure, results, tables,
plots or figures, document, and `study`, which hands them to the pipeline.
"""
