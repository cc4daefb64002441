"""Draw the picture of the paper's method, which reports of `meshreel paper` show as Fig. 1.

    python docs/paper_pipeline.py

Writes docs/images/paper-pipeline.png. A test checks the modules and equations in it.
"""

from pathlib import Path

from meshreel.paper.study.figures.pipeline import draw_pipeline

if __name__ == "__main__":
    draw_pipeline(Path(__file__).parent / "images" / "paper-pipeline.png")
