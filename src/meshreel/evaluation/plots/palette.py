"""Color, line style and marker of each method and codec in all figures."""

from typing import Any

# Okabe and Ito's palette, which color-blind readers can distinguish.
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

# Muted, so that our methods stand out.
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


# Shapes distinguish codecs in print and for color-blind readers; our methods are discs.
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
    """Matplotlib line style of a variant or another codec.

    `pca-qs` is wide, so that it is visible below `pca-qp`, with which it coincides. Variants with
    non-default anchors and recorded codecs are dashed. A codec recorded under a longer name
    (`sz3_lorenzo_2d`) looks like the measured codec.
    """
    method, _, remark = label.partition(" ")
    is_wide = method == "pca-qs"
    codec = method if method in CODEC_COLORS else method.split("_")[0]
    color, width = CODEC_COLORS.get(codec, "#666666"), 1.1
    if method in METHOD_COLORS:
        color, width = METHOD_COLORS[method], 5.0 if is_wide else 1.5
    return {
        "color": color,
        "linewidth": width,
        "alpha": 0.45 if is_wide else 1.0,
        "linestyle": "--" if remark else "-",
    }


def point_marker(label: str) -> str:
    """Matplotlib marker of a variant or another codec."""
    method = label.partition(" ")[0]
    return CODEC_MARKERS.get(method) or CODEC_MARKERS.get(method.split("_")[0], "o")
