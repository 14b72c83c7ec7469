"""Reference pages, as Markdown, from the output of `haff schema` and `--help`: docs/reference/.

    python packaging/reference.py      # writes them; the command is `$HAFF`, or the one of the environment

They are in the repository, so that links to them lead somewhere there, too; a test compares them with the command.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

from haff.command.call import executable

PAGES = Path(__file__).resolve().parents[1] / "docs" / "reference"

# The order of a scene file; other sections follow.
SECTIONS = ("domain", "species", "initial", "particle", "contact", "wall", "pendulum", "spring", "rod", "engine", "run")


def output(*arguments):
    """Standard output of a call of the command."""
    # Lines of help have one width on every terminal.
    environment = {**os.environ, "COLUMNS": "100"}
    done = subprocess.run([executable(), *arguments], capture_output=True, text=True, check=True, env=environment)
    return done.stdout


def scene_reference():
    """Every key of scene files, section by section."""
    schema = json.loads(output("schema"))
    definitions = schema["$defs"]
    page = [
        "# Scene files",
        prose(schema["description"]),
        "A scene is a TOML file. Unknown keys are errors, and every error names its line. `haff schema` prints this "
        "page as a JSON Schema, by which editors complete and check (VS Code: extension *Even Better TOML*, first "
        "line `#:schema haff.schema.json`). `--set KEY=VALUE` and Python's keywords set any key by its dotted path, "
        "elements of lists by index or name: `species.grain.count=500`.",
    ]
    top = {name: about for name, about in schema["properties"].items() if not section_of(about, definitions)}
    page += ["## At the top", table(top, definitions)]
    sections = {name: about for name, about in schema["properties"].items() if name not in top}
    for name in sorted(sections, key=lambda n: SECTIONS.index(n) if n in SECTIONS else len(SECTIONS)):
        page += section(name, sections[name], definitions)
    return "\n\n".join(page) + "\n"


def section_of(about, definitions):
    """The definition behind a table or an array of tables; `None` for a plain value."""
    found = resolved(about.get("items", about), definitions)
    return found if "properties" in found else None


def resolved(about, definitions):
    """A definition with its references resolved; its own keys take precedence over those of the reference."""
    for choice in about.get("anyOf", ()) if len(about.get("anyOf", ())) == 1 else ():
        about = {**resolved(choice, definitions), **{k: v for k, v in about.items() if k != "anyOf"}}
    if "$ref" in about:
        about = {**definitions[about["$ref"].rsplit("/", 1)[1]], **{k: v for k, v in about.items() if k != "$ref"}}
    return about


def section(name, about, definitions):
    """Heading, description and table of a section, and of the tables in it."""
    found = section_of(about, definitions)
    head = f"[[{name}]]" if "items" in about else f"[{name}]"
    parts = [f"## `{head}`", prose(about["description"])]
    if (more := found["description"]) != about["description"]:
        parts.append(prose(more))
    parts.append(table(found["properties"], definitions))
    for key, value in found["properties"].items():
        inner = section_of(value, definitions)
        if inner and inner["properties"]:
            head = f"[[{name}.{key}]]" if "items" in value else f"{name}.{key}"
            parts += [f"### `{head}`", prose(inner["description"]), table(inner["properties"], definitions)]
    return parts


def table(properties, definitions):
    """Keys, their types and their meaning."""
    rows = ["| key | value | |", "|---|---|---|"]
    for key, about in properties.items():
        about = resolved(about, definitions)
        rows.append(f"| `{key}` | {kind(about, definitions)} | {prose(about.get('description', ''))} |")
    return "\n".join(rows)


def kind(about, definitions):
    """The type of a key, in a few words."""
    about = resolved(about, definitions)
    if "const" in about:
        return f"`{json.dumps(about['const'])}`"
    for choices in ("oneOf", "anyOf"):
        if choices in about:
            return " or ".join(kind(choice, definitions) for choice in about[choices])
    if "prefixItems" in about:
        return f"[{', '.join(kind(item, definitions) for item in about['prefixItems'])}]"
    if about.get("type") == "array":
        inner = kind(about["items"], definitions)
        low, high = about.get("minItems"), about.get("maxItems")
        count = "" if high is None else f" × {high}" if low == high else f" × {low} or {high}"
        return f"[{inner}{count}]"
    if "properties" in about:
        return "{ " + ", ".join(f"`{key}`" for key in about["properties"]) + " }"
    words = {
        "number": "number",
        "integer": "integer",
        "string": "string",
        "boolean": "`true`, `false`",
        # Its keys are those of a plug-in.
        "object": "table",
    }
    bounds = []
    if "exclusiveMinimum" in about:
        bounds.append(f"> {about['exclusiveMinimum']:g}")
    if "minimum" in about:
        bounds.append(f"≥ {about['minimum']:g}")
    if "maximum" in about:
        bounds.append(f"≤ {about['maximum']:g}")
    return " ".join([words[about["type"]], *bounds])


def prose(text):
    """A description on one line, safe in a table; [length] is a unit and no link."""
    return re.sub(r"\s+", " ", text).replace("|", "\\|").replace("[", "&#91;")


def command_reference():
    """`--help` of the command and of all its parts."""
    help_text = output("--help")
    page = [
        "# The command",
        "What `haff --help` and `haff COMMAND --help` say. `haff man DIR` writes the same as man pages, and "
        "`haff completions SHELL` prints completions for bash, zsh, fish, elvish and PowerShell.",
        block(help_text),
    ]
    listed = help_text.split("Commands:\n", 1)[1].split("\n\n", 1)[0]
    for name in re.findall(r"^  (\S+)", listed, flags=re.MULTILINE):
        if name != "help":
            page += [f"## haff {name}", block(output(name, "--help"))]
    return "\n\n".join(page) + "\n"


def block(text):
    return f"```text\n{text.rstrip()}\n```"


def pages():
    """The text of each page, by its name."""
    return {"scene.md": scene_reference(), "command.md": command_reference()}


if __name__ == "__main__":
    for name, text in pages().items():
        (PAGES / name).write_text(text, encoding="utf-8")
