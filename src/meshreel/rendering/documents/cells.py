"""Figures as the cells of tables show them."""

NONE = "-"


def number(value: float | None) -> str:
    """A rate with four decimals as the paper prints it."""
    return NONE if value is None else f"{value:.4f}"


def significant(value: float | None) -> str:
    """Three significant digits, never with an exponent."""
    if value is None:
        return NONE
    if value == 0:
        return "0"
    text = f"{value:.3g}"
    return f"{float(text):.0f}" if abs(value) >= 1000 else _without_exponent(text)


def _without_exponent(text: str) -> str:
    return f"{float(text):.12f}".rstrip("0").rstrip(".") if "e" in text else text


def scientific(value: float | None) -> str:
    """Three significant digits with an exponent."""
    return NONE if value is None else f"{value:.2e}"
