"""The shapes in a config, the key for the size of each, and the conversion of a size when the shape changes."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Literal

from drivers.part.contract import Part
from drivers.part.rectangular import Rectangular
from drivers.part.round import Round

Shape = Literal["round", "square", "rectangular"]
DIAMETER, SIDES = "diameter", "sides"
WORDS: dict[Shape, str] = {"round": DIAMETER, "square": SIDES, "rectangular": SIDES}
"""Key of [peg], and of [hole], for the size of each shape."""


@lru_cache(maxsize=64)
def part_of(
    shape: Shape, diameter: float | None, sides: tuple[float, float] | None, chamfer: float, owner: str = "peg"
) -> Part:
    """Return the cross-section that a config describes, with the chamfer of the section `owner`, "peg" or "hole".

    Raises:
        ValueError: The size is missing, is given by the key of another shape, or does not fit the shape; or a part with
            corners has a chamfer; one line.
    """
    word = WORDS[shape]
    said = {DIAMETER: diameter, SIDES: sides}
    if said[word] is None:
        raise ValueError(f'{word}: missing; needed because peg.shape = "{shape}"')
    for other, value in said.items():
        if other != word and value is not None:
            raise ValueError(
                f'{other} = {list(value) if isinstance(value, tuple) else value}: not for peg.shape = "{shape}"; {word} allowed'
            )
    if diameter is not None:
        return Round(diameter, chamfer)
    assert sides is not None
    if chamfer > 0.0:
        raise ValueError(f"{owner}.chamfer = {chamfer}: not for a part with corners; 0, or a round part, allowed")
    if shape == "square" and sides[0] != sides[1]:
        raise ValueError(f'sides = {list(sides)}: not equal; [{sides[0]}, {sides[0]}] or shape = "rectangular" allowed')
    return Rectangular(*sides)


def section_of(diameter: float | None, sides: tuple[float, float] | None, chamfer: float) -> Part:
    """Return the cross-section of a hole; the key that gives its size determines the shape.

    Raises:
        ValueError: Neither key is given, both are, or a hole with corners has a chamfer; one line.
    """
    return part_of("round" if sides is None else "rectangular", diameter, sides, chamfer, "hole")


def follow_shape(merged: Mapping[str, Any], layer: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Rename the sizes of peg and hole to the key of the peg's shape, after a layer of the config was merged.

    If a layer changes the shape and gives no size, the size of the layers below stays: a diameter d becomes sides [d, d],
    and two equal sides become a diameter.

    Args:
        merged: The sections with the layer in them; changed in place.
        layer: The layer alone.

    Returns:
        Section, old key and new key of each renamed size.

    Raises:
        ValueError: The layer gives a size by the key of another shape, or the size of the layers below cannot be kept;
            one line.
    """
    peg = merged.get("peg")
    shape = peg.get("shape", "round") if isinstance(peg, Mapping) else None
    if not isinstance(shape, str) or shape not in WORDS:
        return []
    word = WORDS[shape]
    other = SIDES if word == DIAMETER else DIAMETER
    # Sections of a config with a size.
    return [
        (name, other, word)
        for name in ("peg", "hole")
        if _rename(name, other, shape, merged.get(name), layer.get(name))
    ]


def _rename(name: str, other: str, shape: Shape, section: Any, said: Any) -> bool:
    """Rename the size `other` of a section to the key of the peg's shape; return False if it has no size to rename.

    Args:
        name: Name of the section.
        other: Key of the size of another shape.
        shape: Shape of the peg.
        section: The section with the layer in it; changed in place.
        said: The section in the layer alone.

    Raises:
        ValueError: See `follow_shape`.
    """
    if not isinstance(section, dict) or section.get(other) is None:
        return False
    word, found = WORDS[shape], section.pop(other)
    new = [found, found] if word == SIDES else _side(found)
    if isinstance(said, Mapping) and said.get(other) is not None:
        allowed = word if new is None else f"{word} = {new}"
        raise ValueError(f'{name}.{other} = {found}: not for peg.shape = "{shape}"; {name}.{allowed} allowed')
    if section.get(word) is not None:
        return False
    if new is None:
        raise ValueError(f'{name}.{word}: missing; needed because peg.shape = "{shape}" and {name}.{other} was {found}')
    section[word] = new
    return True


def _side(sides: Any) -> Any:
    """Return the length of equal sides, m, or None for unequal ones."""
    is_pair = isinstance(sides, list | tuple) and len(sides) == 2 and sides[0] == sides[1]
    return sides[0] if is_pair else None
