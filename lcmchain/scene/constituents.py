"""Scene tables of fibre and resin of a cured composite, and published ones to name."""

from __future__ import annotations

import difflib
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import AbsentMeans, Density, Modulus, Number, Range, wrong
from lcmchain.quantities.scene_model import SceneModel
from lcmchain.scene.fabrics import Basis

_POISSON = Range(0.0, 1.0, open_ends=(1.0,))
_OF_RESIN = Range(0.0, 0.5, open_ends=(0.5,))

_EXERCISE = "Soden, Hinton, Kaddour, Composites Science and Technology 58 (1998) 1011"


def _stated(note: str) -> Basis:
    return Basis("stated", note)


#: Published fibres by name: every value as a scene file gives it, and what it rests on.
FIBRES: dict[str, dict[str, tuple[Any, Basis]]] = {
    "T300": {
        "E1": ("230 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "E2": ("15 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "G12": ("15 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "nu12": (0.2, _stated(f"{_EXERCISE}, Table 1")),
        "nu23": (0.0714, _stated(f"E2 / (2 G23) - 1 with G23 = 7 GPa, {_EXERCISE}, Table 1")),
        "density": ("1760 kg/m^3", _stated("Toray, data sheet T300")),
    },
    "AS4": {
        "E1": ("225 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "E2": ("15 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "G12": ("15 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "nu12": (0.2, _stated(f"{_EXERCISE}, Table 1")),
        "nu23": (0.0714, _stated(f"E2 / (2 G23) - 1 with G23 = 7 GPa, {_EXERCISE}, Table 1")),
        "density": ("1790 kg/m^3", _stated("Hexcel, data sheet HexTow AS4")),
    },
    "E-glass": {
        "E1": ("74 GPa", _stated(f"Silenka E-glass 1200 tex, {_EXERCISE}, Table 1")),
        "nu12": (0.2, _stated(f"Silenka E-glass 1200 tex, {_EXERCISE}, Table 1")),
        "density": (
            "2540 kg/m^3",
            _stated("Handbook of Properties of Textile and Technical Fibres, Table 1.4"),
        ),
    },
}

#: Published resins by name.
RESINS: dict[str, dict[str, tuple[Any, Basis]]] = {
    "MY750": {
        "E": ("3.35 GPa", _stated(f"epoxy MY750/HY917/DY063, {_EXERCISE}, Table 2")),
        "nu": (0.35, _stated(f"epoxy MY750/HY917/DY063, {_EXERCISE}, Table 2")),
        "density": ("1200 kg/m^3", Basis("assumed", "usual for a cured epoxy resin")),
    },
    "3501-6": {
        "E": ("4.2 GPa", _stated(f"epoxy 3501-6, {_EXERCISE}, Table 2")),
        "nu": (0.34, _stated(f"epoxy 3501-6, {_EXERCISE}, Table 2")),
        "density": ("1265 kg/m^3", _stated("Hexcel, data sheet HexPly 3501-6")),
    },
}


class Fibre(SceneModel):
    """Fibre of a composite, transversely isotropic about its axis.

    Without ``E2``, ``G12`` and ``nu23`` it is isotropic.
    """

    preset: Annotated[Literal["T300", "AS4", "E-glass"] | None, AbsentMeans("")] = Field(
        default=None, description="Published fibre whose values fill what is left out."
    )
    E1: Modulus = Field(description="Young's modulus along the fibre.")
    E2: Annotated[Modulus | None, AbsentMeans("E1")] = Field(
        default=None, description="Young's modulus across the fibre."
    )
    G12: Annotated[Modulus | None, AbsentMeans("E1 / (2 + 2 nu12)")] = Field(
        default=None, description="Shear modulus along the fibre."
    )
    nu12: Annotated[float, Number(0.2, _POISSON)] = Field(
        description="Poisson's ratio: contraction across the fibre under tension along it."
    )
    nu23: Annotated[Annotated[float, Number(0.07, _POISSON)] | None, AbsentMeans("nu12")] = Field(
        default=None, description="Poisson's ratio in the plane across the fibre."
    )
    density: Annotated[Density | None, AbsentMeans("that of the forming result")] = Field(
        default=None, description="Density of the fibre."
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_preset(cls, values: Any) -> Any:
        return filled(values, FIBRES)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if 1.0 - self.across_poisson - 2.0 * self.nu12**2 * self.across / self.E1 <= 0.0:
            raise wrong(
                "is not possible with the other constants: the fibre would give energy away "
                "(1 - nu23 - 2 nu12^2 E2/E1 has to be positive)",
                field="nu23",
            )
        return self

    @property
    def across(self) -> float:
        """Young's modulus across the fibre [Pa]."""
        return self.E1 if self.E2 is None else self.E2

    @property
    def across_poisson(self) -> float:
        """Poisson's ratio in the plane across the fibre."""
        return self.nu12 if self.nu23 is None else self.nu23

    @property
    def shear(self) -> float:
        """Shear modulus along the fibre [Pa]."""
        return 0.5 * self.E1 / (1.0 + self.nu12) if self.G12 is None else self.G12

    @property
    def across_shear(self) -> float:
        """Shear modulus in the plane across the fibre [Pa]."""
        return 0.5 * self.across / (1.0 + self.across_poisson)


class Resin(SceneModel):
    """Cured resin, isotropic."""

    preset: Annotated[Literal["MY750", "3501-6"] | None, AbsentMeans("")] = Field(
        default=None, description="Published resin whose values fill what is left out."
    )
    E: Modulus = Field(description="Young's modulus.")
    nu: Annotated[float, Number(0.35, _OF_RESIN)] = Field(description="Poisson's ratio.")
    density: Density = Field(description="Density of the cured resin.")

    @model_validator(mode="before")
    @classmethod
    def _fill_preset(cls, values: Any) -> Any:
        return filled(values, RESINS)

    @property
    def shear(self) -> float:
        """Shear modulus [Pa]."""
        return 0.5 * self.E / (1.0 + self.nu)


def filled(values: Any, published: dict[str, dict[str, tuple[Any, Basis]]]) -> Any:
    """Return a table with its entries put over those of the preset that it names."""
    if not isinstance(values, dict) or values.get("preset") is None:
        return values
    preset = values["preset"]
    if preset not in published:
        close = difflib.get_close_matches(str(preset), published, n=1, cutoff=0.3)
        hint = f'; did you mean "{close[0]}"?' if close else f"; there is {', '.join(published)}"
        raise wrong(f'there is no preset "{preset}"{hint}', field="preset")
    return published_values(published, preset) | values


def published_values(
    published: dict[str, dict[str, tuple[Any, Basis]]], name: str | None
) -> dict[str, Any]:
    """Return the entries of a preset as a scene file gives them, its name among them."""
    if name is None:
        return {}
    return {"preset": name} | {key: value for key, (value, _) in published[name].items()}
