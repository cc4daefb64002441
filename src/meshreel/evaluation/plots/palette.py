"""One colour and one line style for each method and codec, the same in every figure."""

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
    "reel": "#4B0092",
    "reel-geometry": "#A679D2",
    "lossless": "#1B7F79",
    "grid": "#5C7A29",
}

# Muted, so that our methods stand out; recorded ones are dashed as well.
CODEC_COLORS = {
    "draco": "#7A4A2B",
    "sz3": "#7F7F1F",
    "zfp": "#8C8C8C",
    "meshopt": "#B0518A",
    "pco": "#3B7D80",
    "fpzip": "#8E5572",
    "famc": "#1F1F5F",
    "vdmc_tm4_motion": "#6B8E23",
    "gltfpack_cc": "#A0785A",
    "o3dgc_dv": "#8899AA",
    "o3dgc_sc3dmc": "#5F7F9F",
}


# Shapes tell apart what colours do not, in print and to every eye; ours are discs.
CODEC_MARKERS = {
    "draco": "s",
    "sz3": "^",
    "zfp": "D",
    "meshopt": "v",
    "pco": "P",
    "fpzip": "*",
    "famc": "X",
    "vdmc_tm4_motion": "<",
    "gltfpack_cc": ">",
    "o3dgc_dv": "h",
    "o3dgc_sc3dmc": "p",
}


def line_style(label: str) -> dict[str, Any]:
    """How matplotlib draws the line of a variant or of another codec.

    `pca-qs` is wide, so that it shows below `pca-qp`, with which it coincides; a variant with
    other than the usual anchors is dashed, as is a recorded codec. A codec that is recorded by a
    longer name (`sz3_lorenzo_2d`) looks as it does where it is measured.
    """
    method, _, remark = label.partition(" ")
    wide = method == "pca-qs"
    codec = method if method in CODEC_COLORS else method.split("_")[0]
    color, width = CODEC_COLORS.get(codec, "#666666"), 1.1
    if method in METHOD_COLORS:
        color, width = METHOD_COLORS[method], 5.0 if wide else 1.5
    return {
        "color": color,
        "linewidth": width,
        "alpha": 0.45 if wide else 1.0,
        "linestyle": "--" if remark else "-",
    }


def point_marker(label: str) -> str:
    """The shape of the points of a variant or of another codec, as matplotlib names it."""
    method = label.partition(" ")[0]
    return CODEC_MARKERS.get(method) or CODEC_MARKERS.get(method.split("_")[0], "o")
