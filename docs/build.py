"""Makes the pages of PAGES below, and the tables in some of them, from the program itself.

With --check, says whether they are up to date, and whether every relative link in README and docs leads somewhere.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import api_page
from click.testing import CliRunner

from mclcli.cli import COMMANDS, group
from mclcli.settings import profiles
from mclcli.settings.robots import names, ros1

ROOT = Path(__file__).resolve().parents[1]
_BEGIN, _END = "<!-- table: made by docs/build.py -->", "<!-- end of table -->"
_BEGIN_ROS1, _END_ROS1 = "<!-- ros1: made by docs/build.py -->", "<!-- end of ros1 -->"
_LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")


def cli_reference() -> str:
    """``--help`` of every command."""
    parts = ["# Command line\n\nMade from `--help` by docs/build.py.\n"]
    for words in ([], *([name] for name in COMMANDS)):
        shown = CliRunner().invoke(group, [*words, "--help"], prog_name="mcl", terminal_width=100).output
        parts.append(f"## {' '.join(['mcl', *words])}\n\n```text\n{shown.rstrip()}\n```\n")
    return "\n".join(parts)


def parameter_reference() -> str:
    """Table of every parameter, and of what each profile changes."""
    lines = [
        "# Parameters\n",
        "Set with `--set NAME=VALUE` or in a file given with `--params`; made from the source by docs/build.py.",
        "Values take units (`sigma_bearing=3deg`, `sigma_hit=5cm`). Names that stand twice belong to different lidar",
        "models. *nav2* is what nav2_amcl calls a parameter, or Beluga where it is marked so; [nav2.md](nav2.md) has",
        "more on files of robots. Tables and sections are of Thrun, Burgard, Fox 2005, *Probabilistic Robotics*.\n",
        "| group | name | default | unit | nav2 | meaning | reference |",
        "|---|---|---|---|---|---|---|",
    ]
    for part, name, default, about in profiles.table():
        meaning = about.meaning + (f"; one of {', '.join(about.choices)}" if about.choices else "")
        reference = profiles.source_of(part, name, about)
        cells = (part, f"`{name}`", _shown(default), about.unit, _robots_names(name), meaning, reference)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, *_profile_table()]) + "\n"


def _profile_table() -> list[str]:
    """Every parameter in which the profiles differ; a row for the models that agree."""
    rows: dict[tuple[str, ...], list[str]] = {}
    for model in profiles.MODELS:
        effective = [profiles.build({}, profile=profile, model=model).values() for profile in profiles.PROFILES]
        for name in effective[0]:
            values = tuple(_shown(one[name]) for one in effective)
            if len(set(values)) > 1:
                rows.setdefault((name, *values), []).append(model)
    lines = [
        "\n# Profiles\n",
        "Where `--profile` makes a difference, by `--model`; each can be set alone as well.",
        "[models.md](models.md) says what they do.\n",
        f"| parameter | model | {' | '.join(profiles.PROFILES)} |",
        f"|---|---|{'---|' * len(profiles.PROFILES)}",
    ]
    for (name, *shown), models in rows.items():
        where = "all" if len(models) == len(profiles.MODELS) else ", ".join(models)
        lines.append(f"| `{name}` | {where} | {' | '.join(shown)} |")
    return lines


def _robots_names(name: str) -> str:
    rows = [row for row in names.TABLE if row.becomes == name]
    return ", ".join(f"`{row.name}`{'' if row.nav2 is not None else ' (Beluga)'}" for row in rows)


def _shown(value: float | str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value) or "(empty)"


def nav2_page() -> str:
    """The page about files of robots, as it stands, with its tables made anew."""
    text = (ROOT / "docs/nav2.md").read_text()
    for begin, end, table in ((_BEGIN_ROS1, _END_ROS1, _ros1_table()), (_BEGIN, _END, _nav2_table())):
        before, _, rest = text.partition(begin)
        text = f"{before}{begin}\n{table}{end}{rest.partition(end)[2]}"
    return text


def _ros1_table() -> str:
    lines = ["| ROS 1 | default | is | what else |", "|---|---|---|---|"]
    for row in ros1.TABLE:
        means = f"`{row.nav2}`" if row.nav2 else ""
        lines.append(f"| `{row.name}` | {_shown(row.default)} | {means} | {row.note} |")
    return "\n".join([*lines, ""])


def _nav2_table() -> str:
    lines = [
        "| parameter | type | nav2_amcl | Beluga | becomes | what else |",
        "|---|---|---|---|---|---|",
    ]
    kinds = {bool: "bool", int: "int", float: "double", str: "string"}
    for row in names.TABLE:
        defaults = ["–" if default is None else _shown(default) for default in (row.nav2, row.beluga)]
        cells = (f"`{row.name}`", kinds[row.kind], *defaults, _becomes(row), _more(row))
        lines.append(f"| {' | '.join(cells)} |")
    generic = [f"`{name}`" for name in names.OF_ANY_NODE] + [f"`{name}…`" for name in names.OF_ANY_NODE_BELOW]
    return "\n".join([*lines, "", f"Every node may have these, without a part in a replay: {', '.join(generic)}.", ""])


def _becomes(row: names.Name) -> str:
    return "" if row.becomes == names.NOTHING else f"`{row.becomes}`"


def _more(row: names.Name) -> str:
    words = {word: own for word, own in row.words.items() if str(word) != own}
    said = [", ".join(f"{_shown(word)}: `{_shown(own)}`" for word, own in words.items())] if words else []
    said += [row.note] if row.note else []
    said += [f"only with {' or '.join(f'`{model}`' for model in row.models)}"] if row.models else []
    return "; ".join(said)


def decisions_index() -> str:
    """Every decision in a line: its title, and what it says of its own status."""
    lines = [
        "# Decisions\n",
        "Why things are as they are, in the order in which it was decided. A decision that a later one replaces or",
        "changes says so at its top; all others are in force. A new one takes the next number, and says what the",
        "matter was (*context*), what was chosen, and what follows from it. This page is made by docs/build.py.\n",
        "| | decision | status |",
        "|---|---|---|",
    ]
    for path in sorted((ROOT / "docs/decisions").glob("[0-9]*.md")):
        text = path.read_text()
        number, _, title = text.partition("\n")[0].removeprefix("# ").partition(". ")
        status = re.search(r"^\*\*Status\.\*\* (.*?)$", text, re.MULTILINE)
        lines.append(f"| {number} | [{title}]({path.name}) | {status[1] if status else 'in force'} |")
    return "\n".join(lines) + "\n"


PAGES = {
    "docs/api.md": api_page.page,
    "docs/cli.md": cli_reference,
    "docs/parameters.md": parameter_reference,
    "docs/nav2.md": nav2_page,
    "docs/decisions/README.md": decisions_index,
}


def stale_pages() -> list[str]:
    """Generated pages that differ from what the program says now."""
    paths = {name: ROOT / name for name in PAGES}
    return [name for name, path in paths.items() if not path.exists() or path.read_text() != PAGES[name]()]


def broken_links() -> list[str]:
    """Relative links of README, CHANGELOG and docs that lead nowhere."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("samples/*.md"), *ROOT.glob("maps/*.md")]
    links = ((page, target) for page in pages for target in _LINK.findall(page.read_text()))
    local = ((page, target) for page, target in links if "://" not in target and not target.startswith("mailto:"))
    return [f"{page.relative_to(ROOT)}: {target}" for page, target in local if not (page.parent / target).exists()]


def main() -> int:
    """Write the pages, or check them."""
    if "--check" not in sys.argv[1:]:
        for name, make in PAGES.items():
            (ROOT / name).write_text(make())
        return 0
    problems = [f"{name} is out of date; run python docs/build.py" for name in stale_pages()]
    problems += [f"{link} leads nowhere" for link in broken_links()]
    print("\n".join(problems) or "docs: up to date, all links lead somewhere")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
