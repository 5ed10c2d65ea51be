"""Hook of mkdocs.yml: the pages that are generated, and links that leave docs/ or lead to notebooks."""

import re
from pathlib import Path
from typing import Any

from docs_site.notebooks import notebook_page
from docs_site.pages import OPTIONS_OF, api, bench_file, options
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
IN_SITE = {  # what files of the repository are in the site
    "README.md": "index.md",
    "observer_rt/data/example_bench.toml": "bench-file.md",
}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add generated pages, scripts, styles and the pictures beside docs/."""
    files.append(File.generated(config, "bench-file.md", content=bench_file()))
    files.append(File.generated(config, "api.md", content=api()))
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        page = notebook_page(path)
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=page.markdown))
        for name, picture in page.pictures.items():
            files.append(File.generated(config, f"notebooks/{name}", content=picture))
    beside = {f"assets/{name}": HERE / name for name in ("iframe-worker.js", "site.css")}
    pictures = {f"pictures/{path.name}": path for path in sorted((ROOT / ".readme").glob("*.png"))}
    for place, path in (beside | pictures).items():
        files.append(File.generated(config, place, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Give links that leave docs/ or lead to notebooks their place in the site, the page of commands every option."""
    if page.file.src_uri.startswith("notebooks/"):
        return markdown
    if page.file.src_uri == OPTIONS_OF:
        markdown += options()
    markdown = re.sub(r"(?<=\]\()(notebooks/\w+)\.ipynb", r"\1.md", markdown)
    return re.sub(r"(?<=\]\()\.\./([^)#\s]+)", lambda found: _in_site(found[1]), markdown)


def _in_site(path: str) -> str:
    return IN_SITE.get(path) or re.sub(r"^\.readme/", "pictures/", path)
