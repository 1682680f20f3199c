"""Writes the reference of case files, docs/case-file.md, from the JSON schema of the program.

    fibreflow check --schema | python scripts/case_reference.py > docs/case-file.md
"""

import json
import sys

SCHEMA = json.load(sys.stdin)


def resolve(schema):
    while "$ref" in schema:
        schema = SCHEMA["$defs"][schema["$ref"].rsplit("/", 1)[1]]
    return schema


def alternatives(schema):
    """The forms a value may take, without null."""
    forms = schema.get("oneOf") or schema.get("anyOf") or [schema]
    return [f for f in map(resolve, forms) if f.get("type") != "null"]


def flat(schema):
    """All forms, through alternatives of alternatives."""
    forms = alternatives(resolve(schema))
    return forms if len(forms) == 1 and forms[0] is resolve(schema) else [g for f in forms for g in flat(f)]


def kind(schema):
    """What a value looks like."""
    words = []
    for form in flat(schema):
        if "const" in form or "enum" in form:
            words += [f'"{v}"' if isinstance(v, str) else str(v) for v in form.get("enum", [form.get("const")])]
            continue
        types = form.get("type", "")
        name = next((t for t in types if t != "null"), "") if isinstance(types, list) else types
        if name == "array":
            count, items = form.get("minItems"), form.get("items", {})
            fixed = f"{count} × " if count and count == form.get("maxItems") else "list of "
            name = fixed + kind(items)
        words.append("table" if name == "object" else name)
    return " or ".join(dict.fromkeys(words))


def bounds(schema):
    form = resolve(schema)
    if "enum" in form:
        return ""
    marks = (("exclusiveMinimum", ">"), ("minimum", "≥"), ("exclusiveMaximum", "<"), ("maximum", "≤"))
    return ", ".join(f"{sign} {form[key]:g}" for key, sign in marks if key in form and form[key] is not None)


def rows(schema, skip=()):
    """A row for every key of a table."""
    required = schema.get("required", [])
    for key, value in schema.get("properties", {}).items():
        if key in skip:
            continue
        form = resolve(value)
        about = value.get("description") or form.get("description", "")
        default = "required" if key in required else json.dumps(value["default"], ensure_ascii=False) if "default" in value else ""
        if len(default) > 40:
            default = "see below"
        limits = bounds(value)
        cells = (f"`{key}`", kind(value) + (f" {limits}" if limits else ""), default, about.replace("\n", " "))
        yield "| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |"


def table(schema, skip=()):
    lines = list(rows(schema, skip))
    if lines:
        print("\n| key | value | default | |\n|---|---|---|---|")
        print("\n".join(lines))


def section(path, schema, depth=2, seen=None):
    """A heading for a table of the case file, its keys, and its inner tables, each of which is described once."""
    forms = [f for f in flat(schema) if "properties" in f or "additionalProperties" in f]
    seen = set() if seen is None else seen
    if not forms or path in seen:
        return
    seen.add(path)
    about = schema.get("description") or resolve(schema).get("description", "")
    print(f"\n{'#' * min(depth, 4)} `{path}`\n\n{about}")
    for form in forms:
        tag = form.get("properties", {}).get("kind", {}).get("const")
        if tag:
            print(f"\n`kind = \"{tag}\"`: {form.get('description', '')}")
            table(form, skip=("kind",))
        else:
            if len(forms) > 1 and "description" in form:
                about = form["description"].replace("\n", " ")
                print(f"\n{about}")
            table(form)
    for form in forms:
        for key, value in form.get("properties", {}).items():
            inner = resolve(value)
            if inner.get("type") == "array" and "$ref" in inner.get("items", {}) and inner.get("minItems") is None:
                section(f"{path}.{key}[]", inner["items"], depth + 1, seen)
            elif "const" not in inner:
                section(f"{path}.{key}", value, depth + 1, seen)
        if isinstance(form.get("additionalProperties"), dict):
            section(f"{path}.NAME", form["additionalProperties"], depth + 1, seen)


def main():
    print("# Case files\n")
    print("Written by `scripts/case_reference.py` from `fibreflow check --schema`. All quantities are in SI units: m, kg, s, N, Pa.")
    print("Unknown keys are refused. `--set key=value` changes a key for one run, as in `--set fluid.viscosity=1e-3` or")
    print("`--set fibres.0.placement.count=10`.")
    for name, value in SCHEMA["properties"].items():
        form = resolve(value)
        if form.get("type") == "array":
            section(f"{name}[]", form["items"])
        else:
            section(name, value)


if __name__ == "__main__":
    main()
