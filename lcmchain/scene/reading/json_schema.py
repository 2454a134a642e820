"""JSON Schema of scene files, for completion and checks in editors."""

from __future__ import annotations

import copy
from typing import Any

from lcmchain.scene.presets import PRESETS
from lcmchain.scene.scene import Scene


def scene_json_schema() -> dict[str, Any]:
    """Describe scene files as a JSON Schema; quantities are texts with an example."""
    schema = Scene.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "lcmchain scene"
    definitions = schema["$defs"]
    _allow_presets(schema, definitions)
    _allow_element_name(schema, definitions)
    for title, definition in definitions.items():
        # The key that chooses the form must be written in a file, unless a preset or the default
        # form implies it.
        for key in ("law", "type"):
            chooses = "const" in definition.get("properties", {}).get(key, {})
            if chooses and title not in ("PresetMaterial", "Element"):
                definition["properties"][key].pop("default", None)
                required = definition.setdefault("required", [])
                if key not in required:
                    required.insert(0, key)
    return _without_null(schema)


def _allow_presets(schema: dict[str, Any], definitions: dict[str, Any]) -> None:
    """Offer a material that names a preset and then needs none of the other keys."""
    preset = copy.deepcopy(definitions["FabricMaterial"])
    preset["title"] = "PresetMaterial"
    preset["description"] = "Published fabric; keys that are given replace the published values."
    preset["required"] = ["preset"]
    preset["properties"]["preset"] = {"type": "string", "enum": sorted(PRESETS)}
    for name in ("membrane", "compaction", "bending"):
        full_name = preset["properties"][name]["$ref"].rsplit("/", 1)[1]
        partial = copy.deepcopy(definitions[full_name])
        partial.pop("required", None)
        definitions[f"Preset{full_name}"] = partial
        preset["properties"][name] = {"$ref": f"#/$defs/Preset{full_name}"}
    definitions["PresetMaterial"] = preset
    definitions["FabricMaterial"]["properties"].pop("preset")
    (named,) = schema["properties"]["materials"]["patternProperties"].values()
    for entry in (schema["properties"]["material"], named):
        laws = _forms(entry)
        entry["anyOf"] = [{"$ref": "#/$defs/PresetMaterial"}, *laws]


def _forms(entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Take the forms of a table out of its entry, also where it may be left out."""
    for form in (entry, *entry.get("anyOf", ())):
        if "oneOf" in form:
            form.pop("discriminator", None)
            forms = form.pop("oneOf")
            entry.pop("anyOf", None)
            return forms
    raise KeyError("no forms")


def _allow_element_name(schema: dict[str, Any], definitions: dict[str, Any]) -> None:
    """Offer the name of a kind of element in place of its table."""
    for entry in (
        schema["properties"]["element"],
        definitions["Ply"]["properties"]["element"],
    ):
        tables = _forms(entry)
        names = [
            definitions[table["$ref"].rsplit("/", 1)[1]]["properties"]["type"]["const"]
            for table in tables
        ]
        entry["anyOf"] = [{"type": "string", "enum": names}, *tables]


def _without_null(node: object) -> Any:
    """Drop null from the schema: TOML has none, an optional entry is simply left out."""
    if isinstance(node, list):
        return [_without_null(item) for item in node if item != {"type": "null"}]
    if not isinstance(node, dict):
        return node
    result = {
        key: _without_null(value)
        for key, value in node.items()
        if not (key == "default" and value is None)
    }
    if len(result.get("anyOf", ())) == 1:
        result |= result.pop("anyOf")[0]
    return result
