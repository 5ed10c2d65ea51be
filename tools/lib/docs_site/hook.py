"""Hook of mkdocs.yml: the pages made of the package and of the notebooks, and links that leave docs/."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer.main
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbconvert import MarkdownExporter

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.desk.cli.app import app_of

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
COMMANDS = "commands.md"
MOVED = {  # files of the repository that have another name in the site
    "README.md": "index.md",
    "observer_rt/data/example_bench.toml": "bench-file.md",
}
BENCH_FILE = """# Bench file

`observer-rt run --print-example-bench` prints this complete file. A line that begins with `#` may be left out;
it shows the default or an example. Unknown keys are errors.

```toml
{}```
"""
API = """# API

The public names, from their docstrings; [as a library](library.md) has programs. Units are SI. What a caller can
correct is a `UserError` with place, problem and remedy.
"""
_LIBRARY_ROW = re.compile(r"^- ([^`]+), `(observer_rt[\w.]*)`: (.+)$", re.MULTILINE)
_TABLE_STYLE = re.compile(r"<style.*?</style>\n?|(?<=<table)[^>]*", re.DOTALL)  # the site has its own


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add generated pages, styles and the pictures beside docs/."""
    files.append(File.generated(config, "bench-file.md", content=bench_file()))
    files.append(File.generated(config, "api.md", content=api()))
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        markdown, pictures = notebook(path)
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=markdown))
        for name, picture in pictures.items():
            files.append(File.generated(config, f"notebooks/{name}", content=picture))
    files.append(File.generated(config, "assets/site.css", abs_src_path=str(HERE / "site.css")))
    for path in sorted((ROOT / ".readme").glob("*.png")):
        files.append(File.generated(config, f"pictures/{path.name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Give links that leave docs/ their place in the site, and the page of commands its help."""
    if page.file.src_uri.startswith("notebooks/"):
        return markdown
    if page.file.src_uri == COMMANDS:
        markdown += command_help()
    markdown = re.sub(r"(?<=\]\()(notebooks/\w+)\.ipynb", r"\1.md", markdown)
    markdown = re.sub(r"(?<=\]\()\.\./\.readme/", "pictures/", markdown)
    return re.sub(r"(?<=\]\()\.\./([^)#\s]+)", lambda link: MOVED.get(link[1], link[1]), markdown)


def bench_file() -> str:
    """The page of the bench file: the example, whose comments explain every section and key."""
    return BENCH_FILE.format(EXAMPLE_BENCH.read_text(encoding="utf-8"))


def command_help() -> str:
    """The help of every command, as the terminal shows it."""
    group: Any = typer.main.get_command(app_of())
    root = typer.Context(group, info_name="observer-rt")
    texts = (
        f"\n### observer-rt {name}\n\n```text\n"
        f"{command.get_help(typer.Context(command, parent=root, info_name=name, max_content_width=110))}\n```\n"
        for name, command in group.commands.items()
    )
    return "\n## Every option\n" + "".join(texts)


def api() -> str:
    """The page of the library: the names that docs/library.md lists, for mkdocstrings."""
    rows = _LIBRARY_ROW.findall((ROOT / "docs" / "library.md").read_text(encoding="utf-8"))
    return API + "".join(
        f"\n## {subject[0].upper()}{subject[1:]}\n\n`{module}`\n\n"
        + "".join(f"::: {module}.{name}\n\n" for name in re.findall(r"`(\w+)`", names))
        for subject, module, names in rows
    )


def notebook(path: Path) -> tuple[str, Mapping[str, bytes]]:
    """The Markdown of a notebook with the outputs stored in it, and its pictures by file name."""
    exporter = MarkdownExporter()
    resources = {"unique_key": path.stem, "output_files_dir": "."}
    markdown, resources = exporter.from_filename(str(path), resources=resources)
    pictures = {Path(name).name: content for name, content in resources["outputs"].items()}
    for name in resources["outputs"]:
        markdown = markdown.replace(f"({name})", f"({Path(name).name})")
    heading, _, text = _TABLE_STYLE.sub("", markdown).lstrip().partition("\n")
    source = f"*Made of [{path.name}]({path.name}), to be run in Jupyter.*"
    return f"{heading}\n\n{source}\n{text}", pictures
