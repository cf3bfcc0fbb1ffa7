"""Makes docs/cli.md and docs/parameters.md from the program itself; with --check, says whether they are up to date.

Also checks that every relative link in README and docs leads somewhere.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from click.testing import CliRunner

from mclcli import profiles
from mclcli.cli import COMMANDS, group

ROOT = Path(__file__).resolve().parents[1]
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
        "Values take units (`sigma_bearing=3deg`, `sigma_hit=5cm`). *nav2* marks names that nav2_amcl has as well.",
        "Names that stand twice belong to different lidar models.\n",
        "| group | name | default | unit | nav2 | meaning |",
        "|---|---|---|---|---|---|",
    ]
    for part, name, default, about in profiles.table():
        meaning = about.meaning + (f"; one of {', '.join(about.choices)}" if about.choices else "")
        cells = (part, f"`{name}`", _shown(default), about.unit, "nav2" if about.in_nav2 else "", meaning)
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["\n# Profiles\n", "What `--profile` changes of these defaults, by `--model`.\n"]
    for profile, models in profiles.PROFILES.items():
        for model, changes in models.items():
            words = ", ".join(f"`{name}={_shown(value)}`" for name, value in changes.items())
            lines.append(f"- **{profile}, {model}**: {words or 'nothing'}")
    return "\n".join(lines) + "\n"


def _shown(value: float | str) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value) or "(empty)"


PAGES = {"docs/cli.md": cli_reference, "docs/parameters.md": parameter_reference}


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
