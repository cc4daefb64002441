"""XML parser for untrusted files: no entities, no external files, bounded depth."""

from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from meshreel.errors import FormatError

MAX_DEPTH = 200


def parse_xml(data: bytes) -> Element:
    """Return the root element of an XML document.

    Raises
    ------
    FormatError
        If it is not well formed, declares entities, or is nested too deeply.
    """
    builder, depth = TreeBuilder(), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise FormatError(f"has elements nested deeper than {MAX_DEPTH} levels")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(name: str, *rest: Any) -> None:
        raise FormatError(f"declares the entity {name!r}; entities are not supported")

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise FormatError(f"is not XML, or is damaged ({error})") from error
    root: Element = builder.close()
    return root


def local_name(element: Element) -> str:
    """Tag of an element without its namespace prefix."""
    return element.tag.rpartition(":")[2]
