"""One colour and one line style for each method, the same in every figure."""

from typing import Any

# Okabe and Ito's palette, which colour-blind readers can tell apart.
METHOD_COLORS = {
    "pca": "#56B4E9",
    "pca-q": "#0072B2",
    "v2v": "#E69F00",
    "pca-qs": "#CC79A7",
    "pca-qp": "#D55E00",
    "blocks": "#009E73",
    "gft": "#000000",
}


def line_style(label: str) -> dict[str, Any]:
    """How matplotlib draws the line of a variant.

    `pca-qs` is wide, so that it shows below `pca-qp`, with which it coincides; a variant with
    other than the usual anchors is dashed.
    """
    method, _, remark = label.partition(" ")
    wide = method == "pca-qs"
    return {
        "color": METHOD_COLORS.get(method, "#666666"),
        "linewidth": 5.0 if wide else 1.5,
        "alpha": 0.45 if wide else 1.0,
        "linestyle": "--" if remark else "-",
    }
