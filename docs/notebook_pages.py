"""Hook of the documentation site (mkdocs.yml) that runs the notebooks and adds their pages, with outputs and pictures.

The notebooks of docs/notebooks are Python scripts with cells in the percent format of jupytext. An error in a cell, or
output on the standard error, such as a warning, ends the build. Executed notebooks are stored in out/notebooks and
reused until the notebook or the code of meeframe changes.
"""

import base64
import hashlib
import os
import re
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from logging import getLogger
from pathlib import Path
from queue import Empty
from typing import Any, Final

import jupytext
import nbformat
from jupyter_client.channels import AsyncZMQSocketChannel
from jupyter_client.client import KernelClient
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from nbformat import NotebookNode
from traitlets.config import Config

LOG: Final = getLogger("mkdocs.notebook_pages")
ROOT: Final = Path(__file__).parents[1]
NOTEBOOKS: Final = ROOT / "docs" / "notebooks"
STORE: Final = ROOT / "out" / "notebooks"
CELL_SECONDS: Final = 600
"""Longest time of a cell; the first one to use a kernel of numba compiles it."""
POLL_SECONDS: Final = 1.0
"""Longest time that passes before the client looks whether an answer has come without its notice."""

LINK: Final = re.compile(r"(\]\((?:[\w.-]+/)*)([\w-]+)\.py(#[\w-]+)?\)")
"""Link to a notebook: text before its name, name, anchor."""

TABLE: Final = re.compile(r'<table border="1" class="dataframe">')
"""Tables of pandas, which the theme styles if they have no class."""

WIDGET: Final = "application/vnd.jupyter.widget-view+json"
"""Type of the output of a widget; progress bars need a kernel."""

EMPTY: Final = re.compile(r"<pre[^>]*></pre>\s*")
"""Output that rich writes after its bars."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page, its pictures and the notebook with outputs for each notebook."""
    sources = sorted(NOTEBOOKS.glob("*.py"))
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # each notebook runs in a process
        notebooks = list(pool.map(executed, sources))
    for source, notebook in zip(sources, notebooks, strict=True):
        pictures: dict[str, bytes] = {}
        page = "\n\n".join(_page(source.stem, notebook, pictures))
        files.append(File.generated(config, f"notebooks/{source.stem}.md", content=page))
        files.append(File.generated(config, f"notebooks/{source.stem}.ipynb", content=nbformat.writes(notebook)))
        for name, picture in pictures.items():
            files.append(File.generated(config, f"notebooks/{name}", content=picture))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links to notebooks at their pages."""

    def mend(match: re.Match[str]) -> str:
        start, name, anchor = match.groups()
        return f"{start}{name}.md{anchor or ''})" if (NOTEBOOKS / f"{name}.py").exists() else match[0]

    return LINK.sub(mend, markdown)


def executed(source: Path) -> NotebookNode:
    """Return a notebook with outputs, from the store if neither it nor the code of meeframe has changed."""
    digest = _digest(source)
    stored = STORE / f"{source.stem}.ipynb"
    if stored.exists():
        notebook = nbformat.read(stored, as_version=4)
        if notebook.metadata.get("digest") == digest:
            return notebook
    notebook = jupytext.read(source)
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:  # notebooks may write files
        client = _Client(
            notebook,
            timeout=CELL_SECONDS,
            kernel_name="python3",
            config=Config(KernelManager={"transport": "ipc", "ip": f"{folder}/kernel"}),  # no open port
            shutdown_kernel="immediate",
            resources={"metadata": {"path": folder}},
            extra_arguments=["--InlineBackend.figure_formats={'retina'}"],
        )
        try:
            client.execute()
        except CellExecutionError as error:
            raise PluginError(f"{source.name}: a cell fails\n{error}") from None
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            if output.output_type == "stream" and output.name == "stderr":
                raise PluginError(f"{source.name}: a cell writes to the standard error\n{cell.source}\n{output.text}")
        if "outputs" in cell:
            cell.outputs = list(_shown(cell.outputs))
    LOG.info("%s: run in %.1f s", source.name, time.monotonic() - start)
    notebook.metadata.pop("widgets", None)
    notebook.metadata["digest"] = digest
    stored.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, stored)
    return notebook


class _Client(NotebookClient):
    """A client of a kernel that does not rely on being told of messages.

    On a busy machine it is sometimes not told of an answer, and would wait until the longest time of a cell is over.
    """

    async def async_start_new_kernel_client(self) -> KernelClient:
        """Start a client whose waits for messages are divided into short ones."""
        client = await super().async_start_new_kernel_client()
        for channel in (client.shell_channel, client.iopub_channel):
            channel.get_msg = _in_short_waits(channel)
        return client


def _in_short_waits(channel: AsyncZMQSocketChannel) -> Any:
    """Return the function of a channel that waits for a message, which begins to wait again every POLL_SECONDS."""
    receive = channel.get_msg

    async def get_msg(timeout: float | None = None) -> dict[str, Any]:
        end = float("inf") if timeout is None else time.monotonic() + timeout
        while True:
            left = max(0.0, end - time.monotonic())
            try:
                return await receive(timeout=min(POLL_SECONDS, left))
            except Empty:
                if left <= POLL_SECONDS:
                    raise

    return get_msg


def _digest(source: Path) -> str:
    """Return a digest of a notebook, of this file and of all files of meeframe and its plugins."""
    code = (path for folder in ("meeframe", "plugins") for path in (ROOT / folder).rglob("*") if _is_code(path))
    digest = hashlib.sha256()
    for path in (source, Path(__file__), *sorted(code)):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _is_code(path: Path) -> bool:
    return path.suffix in (".py", ".toml", ".mplstyle") and "tests" not in path.parts


def _shown(outputs: list[NotebookNode]) -> Iterator[NotebookNode]:
    """Yield outputs without progress bars and the text of objects beside their picture; join printed lines."""
    has_picture = any("image/png" in output.get("data", {}) for output in outputs)
    printed = None
    for output in outputs:
        data = output.get("data", {})
        if WIDGET in data or EMPTY.fullmatch(data.get("text/html", " ")):
            continue
        if output.output_type == "execute_result" and "text/html" not in data and has_picture:
            continue
        if output.output_type == "stream" and printed is not None:
            printed.text += output.text
            continue
        printed = output if output.output_type == "stream" else None
        yield output


def _page(name: str, notebook: NotebookNode, pictures: dict[str, bytes]) -> Iterator[str]:
    """Yield the parts of the page of a notebook, and add its pictures."""
    heading = ""
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            yield cell.source
            if not heading:
                yield f"*Download this page as a notebook: [{name}.ipynb]({name}.ipynb).*"
            heading = next(iter(re.findall(r"^#+ (.*)$", cell.source, re.MULTILINE)[-1:]), heading)
        elif cell.source:
            yield f"```python\n{cell.source}\n```"
            for output in cell.outputs:
                yield from _output(name, heading, output, pictures)


def _output(name: str, heading: str, output: NotebookNode, pictures: dict[str, bytes]) -> Iterator[str]:
    """Yield what a page shows of an output of a cell."""
    if output.output_type == "stream":
        yield _text(output.text)
        return
    data = output.get("data", {})
    if "image/png" in data:
        path = f"{name}/{len(pictures) + 1}.png"
        pictures[path] = base64.b64decode(data["image/png"])
        width = output.metadata.get("image/png", {}).get("width")
        attributes = f'{{ width="{width}" .output }}' if width else "{ .output }"
        yield f"![{heading}]({path}){attributes}"
    elif "text/html" in data and "xr-wrap" not in data["text/html"]:  # xarray's HTML is long and needs its styles
        html = TABLE.sub("<table>", data["text/html"])
        lines = (line for line in html.splitlines() if line.strip())  # an empty line ends HTML in Markdown
        yield "\n".join(['<div class="output">', *lines, "</div>"])
    elif "text/plain" in data:
        yield _text(data["text/plain"])


def _text(text: str) -> str:
    return f"``` {{ .text .output }}\n{text.rstrip()}\n```"
