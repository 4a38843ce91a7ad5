"""The part of JSON Schema that the schemas of the job file and of edit scripts use, read as assertions."""

import numpy as np


def check_schema(value, schema: dict, defs: dict) -> None:
    """Assert that a value fits a schema."""
    if "$ref" in schema:
        return check_schema(value, defs[schema["$ref"].rsplit("/", 1)[1]], defs)
    options = schema.get("anyOf") or schema.get("oneOf")
    if options:
        errors = 0
        for option in options:
            try:
                return check_schema(value, option, defs)
            except AssertionError:
                errors += 1
        raise AssertionError(f"{value!r} fits none of {errors} alternatives")
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "number": (int, float), "integer": int}
    if schema.get("type") == "null":
        assert value is None
    elif "type" in schema:
        assert isinstance(value, kinds[schema["type"]])
    assert value in schema.get("enum", [value])
    assert value == schema.get("const", value)
    if isinstance(value, int | float):
        assert value > schema.get("exclusiveMinimum", -np.inf)
        assert schema.get("minimum", -np.inf) <= value <= schema.get("maximum", np.inf)
    if isinstance(value, list):
        assert schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 10**9)
        for number, item in enumerate(value):
            prefix = schema.get("prefixItems", [])
            check_schema(item, prefix[number] if number < len(prefix) else schema.get("items", {}), defs)
    if isinstance(value, dict) and schema.get("type") == "object":
        assert set(schema.get("required", [])) <= set(value)
        assert all(set(more) <= set(value) for key, more in schema.get("dependentRequired", {}).items() if key in value)
        for key, item in value.items():
            assert key in schema.get("properties", {}) or schema.get("additionalProperties")
            check_schema(item, schema.get("properties", {}).get(key, {}), defs)
    return None
