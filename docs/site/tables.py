"""Tables of the reference, made from the code and the configuration, so that they stay true."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields

from ertskin.commands import verbs
from ertskin.configuration import choices, config_dir
from ertskin.diagnosis.criteria import Criteria, described
from ertskin.physics.effects.effect import Effect
from ertskin.physics.effects.registry import effect_classes
from ertskin.settings import limits_of


def commands() -> str:
    """Every command with the first line of its docstring."""
    rows = [f"| [`ertskin {name}`](#{name}) | {text.splitlines()[0]} |" for name, text in verbs().items()]
    return "\n".join(["| command | what it does |", "| --- | --- |", *rows])


def command_pages() -> str:
    """Every command with its docstring, and its settings as they stand in its configuration."""
    parts = []
    for name, text in verbs().items():
        settings = (config_dir() / f"{name}.yaml").read_text(encoding="utf-8").strip()
        parts.append(f'## {name}\n\n{text}\n\n```yaml title="conf/{name}.yaml"\n{settings}\n```\n')
    return "\n".join(parts)


def groups() -> str:
    """Every group of choices with what each choice says of itself in its first comment."""
    parts = []
    for folder in sorted(path for path in config_dir().iterdir() if path.is_dir()):
        if folder.name == "effects":
            continue
        rows = [f"| `{folder.name}={name}` | {_comment(folder.name, name)} |" for name in choices(folder.name)]
        parts.append(f"## {folder.name}\n\n| choice | what it is |\n| --- | --- |\n" + "\n".join(rows) + "\n")
    return "\n".join(parts)


def effects() -> str:
    """Every effect by stage: what it is."""
    rows = [f"| {kind.stage} | [`{name}`](#{name}) | {_summary(kind)} |" for name, kind in effect_classes().items()]
    return "\n".join(["| stage | effect | what it is |", "| --- | --- | --- |", *rows])


def effect_pages() -> str:
    """Every effect with its form, parameters and source."""
    parts = []
    for name, kind in effect_classes().items():
        rows = [
            f"| `{key}` | {known.unit} | {known.low:g} to {known.high:g} | {known.neutral:g} | {known.meaning} |"
            for key, known in (kind.parameters() | {f"{key}[k]": one for key, one in kind.several().items()}).items()
        ]
        head = ["| parameter | unit | range | default | meaning |", "| --- | --- | --- | --- | --- |"]
        table = "\n".join([*head, *rows])
        parts.append(f"## {name}\n\n{inspect.getdoc(kind)}\n\n{table}\n\nSource: {kind.source}.\n")
    return "\n".join(parts)


def criteria() -> str:
    """Every number that a diagnosis decides by: its default, unit and limits, what it means, what set it."""
    about = described()
    rows = [
        f"| `{each.name}` | {each.default:g} {about[each.name].unit}, {_range(limits_of(each))} "
        f"| {about[each.name].meaning} | {about[each.name].source} |"
        for each in fields(Criteria)
    ]
    return "\n".join(["| criterion | default, limits | meaning | set by |", "| --- | --- | --- | --- |", *rows])


def _range(limits: Mapping[str, float]) -> str:
    words = {"above": "above {:g}", "least": "at least {:g}", "most": "at most {:g}"}
    return " and ".join(words[limit].format(bound) for limit, bound in limits.items())


def _summary(kind: type[Effect]) -> str:
    """What the effect's file says it is about."""
    text = inspect.getdoc(inspect.getmodule(kind)) or ""
    return text.splitlines()[0].replace("|", "\\|")


def _comment(group: str, name: str) -> str:
    """The comment at the head of a choice's file."""
    head = []
    for line in (config_dir() / group / f"{name}.yaml").read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        if not line.startswith("# @package"):
            head.append(line.lstrip("# "))
    return " ".join(head)


TABLES: dict[str, Callable[[], str]] = {
    "commands": commands,
    "command_pages": command_pages,
    "groups": groups,
    "criteria": criteria,
    "effects": effects,
    "effect_pages": effect_pages,
}
