"""Kinds and domains have the same names and numbers in Python, C, TypeScript and C#."""

import re
from pathlib import Path

from meshreel.codec.surface.codes import DOMAINS, KINDS
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS

ROOT = Path(__file__).parents[3]
PLURALS = dict(zip(("vertices", "faces", "corners", "cells"), Domain, strict=True))


def in_c(name, prefix="MESHREEL_"):
    [body] = re.findall(rf"enum {name} {{(.*?)}}", read("core/include/meshreel.h"), re.DOTALL)
    return {
        word.lower(): int(number) for word, number in re.findall(rf"{prefix}(\w+) = (\d+)", body)
    }


def in_csharp(name):
    [body] = re.findall(
        rf"enum {name}\s*{{(.*?)}}", read("integrations/csharp/Meshreel.cs"), re.DOTALL
    )
    return {word.lower(): int(number) for word, number in re.findall(r"(\w+) = (\d+)", body)}


def in_typescript(name, file):
    [body] = re.findall(rf"const {name} = \[(.*?)\] as const", read(f"npm/src/core/{file}.ts"))
    return {word: number for number, word in enumerate(re.findall(r'"(\w+)"', body))}


def read(path):
    return (ROOT / path).read_text("utf-8")


def test_kinds_of_tracks():
    kinds = {kind.value: row.code for kind, row in KIND_ROWS.items()}
    assert in_c("meshreel_track_kind", "MESHREEL_TRACK_") == kinds
    assert in_csharp("ReelTrackKind") == in_typescript("KINDS", "file") == kinds


def test_kinds_of_attributes():
    kinds = {kind.value: number for number, kind in enumerate(KINDS)}
    assert in_c("meshreel_attribute_kind") == in_csharp("ReelAttributeKind") == kinds
    assert in_typescript("KINDS", "surface") == kinds


def test_domains():
    domains = {domain.value: number for number, domain in enumerate(DOMAINS)}
    assert in_typescript("DOMAINS", "file") == domains
    for found in (in_c("meshreel_domain"), in_csharp("ReelDomain")):
        assert {PLURALS[name].value: number for name, number in found.items()} == domains
