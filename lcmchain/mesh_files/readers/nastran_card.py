"""One entry of Nastran bulk data, and the numbers in its fields."""

from __future__ import annotations

from dataclasses import dataclass

from lcmchain.mesh_files.file_mesh import Place
from lcmchain.mesh_files.readers.deck_text import real_number


@dataclass
class Card:
    """A bulk data entry: name in upper case without ``*``, and its data fields as text.

    Fields are counted from 0 behind the name; the eight of each line follow each other.
    """

    name: str
    fields: list[str]
    place: Place

    def text(self, field: int) -> str:
        return self.fields[field] if field < len(self.fields) else ""

    def whole(self, field: int, default: int | None = None) -> int:
        """Return a field as a number.

        Raises
        ------
        InputError : it is none, or blank and there is no default.
        """
        text = self.text(field)
        if not text and default is not None:
            return default
        try:
            number = int(text)
        except ValueError:
            number = -1
        if not 0 <= number < 10**17:
            raise self.place.error(f'field {field + 2} of {self.name} is "{text}", not a number')
        return number

    def real(self, field: int) -> float:
        """Return a field as a real number; ``1.5-3`` is 1.5e-3, a blank one 0.

        Raises
        ------
        InputError : it is none.
        """
        text = self.text(field)
        if not text:
            return 0.0
        try:
            return real_number(text)
        except ValueError:
            raise self.place.error(
                f'field {field + 2} of {self.name} is "{text}", not a number'
            ) from None
