"""Numbers as text for the cells of tables."""

NONE = "-"


def number(value: float | None) -> str:
    """Four decimals, as the paper prints rates."""
    return NONE if value is None else f"{value:.4f}"


def significant(value: float | None) -> str:
    """Three significant digits, never with an exponent."""
    if value is None:
        return NONE
    if value == 0:
        return "0"
    text = f"{value:.3g}"
    if abs(value) >= 1000:
        return f"{float(text):.0f}"
    return f"{float(text):.12f}".rstrip("0").rstrip(".") if "e" in text else text


def scientific(value: float | None) -> str:
    """Three significant digits with an exponent."""
    return NONE if value is None else f"{value:.2e}"
