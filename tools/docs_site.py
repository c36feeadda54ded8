"""Hooks of MkDocs: pages that are made from files outside docs/, and mathematics without scripts.

Links of pages to such files lead to the code host's view of them there, and to pages made here on
the site: the home page is README.md, `files/…` shows parameter files and examples. The reference
of the Python names and of the messages is made from the sources, so nothing can be missing.
"""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from posixpath import relpath
from typing import Any
from xml.etree.ElementTree import Element

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent
MARKDOWN = {
    'README.md': 'index.md',
    'CONTRIBUTING.md': 'contributing.md',
    'CHANGELOG.md': 'changelog.md',
}
"""Pages that are files elsewhere, by their paths in the repository."""
REFERENCE = {
    'api/tp_controller.md': ('The library: tp_controller', 'tp_controller'),
    'api/batch.md': ('Batches: tp_controller.batch', 'tp_controller.batch'),
    'api/recording.md': ('Recordings: tp_controller.recording', 'tp_controller.recording'),
    'api/plots.md': ('Pictures: tp_controller.plots', 'tp_controller.plots'),
    'api/planning.md': ('Ways around: tp_controller.planning', 'tp_controller.planning'),
    'api/harness.md': ('The harness: tp_sim.harness', 'tp_sim.harness'),
}
"""Title and module of the pages on Python names."""
LINK = re.compile(r'\]\((?!\w+:)([^()#\s]+)(#[^()\s]*)?\)')
LANGUAGES = {'.py': 'python', '.toml': 'toml', '.yaml': 'yaml', '.md': 'markdown'}
SKIPPED = {'__pycache__', 'build', 'dist'}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the mathematics of pages: ``$…$`` and fences of the language math."""
    fence = {'name': 'math', 'class': 'math', 'format': _display}
    config.mdx_configs.setdefault('pymdownx.superfences', {})['custom_fences'] = [fence]
    config.markdown_extensions.append(_Math())  # type: ignore[arg-type]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are not files of docs/."""
    pages = {f'docs/{file.src_uri}': file.content_string for file in files.documentation_pages()}
    for path, uri in MARKDOWN.items():
        pages[path] = (ROOT / path).read_text(encoding='utf-8')
        files.append(File.generated(config, uri, content=pages[path]))
    waiting = [path for page, text in pages.items() for path in _outside(page, text)]
    seen = set(pages)
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        text = _shown(path)
        files.append(File.generated(config, _uri(path), content=text))
        waiting += _outside(path, text)
    for uri, (title, module) in REFERENCE.items():
        files.append(File.generated(config, uri, content=_names(title, module)))
    files.append(File.generated(config, 'messages.md', content=_messages()))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links to files outside docs/ lead to their pages."""
    here = page.file.src_uri
    source = _source(here)

    def rewritten(match: re.Match[str]) -> str:
        target = _target(source, match[1])
        if target is None:
            return match[0]
        uri = target.removeprefix('docs/') if target.startswith('docs/') else _uri(target)
        return f']({relpath(uri, str(Path(here).parent))}{match[2] or ""})'

    return LINK.sub(rewritten, markdown)


def _source(uri: str) -> str:
    """Path in the repository of a page of the site."""
    for path, page in MARKDOWN.items():
        if uri == page:
            return path
    if uri.startswith('files/'):
        return uri.removeprefix('files/').removesuffix('.md').removesuffix('/index')
    return f'docs/{uri}'


def _uri(path: str) -> str:
    """Page of the site for a path in the repository outside docs/."""
    if path in MARKDOWN:
        return MARKDOWN[path]
    return f'files/{path}/index.md' if (ROOT / path).is_dir() else f'files/{path}.md'


def _target(source: str, link: str) -> str | None:
    """Path in the repository that a link of a page leads to, None if there is nothing."""
    # Pages of folders list what is in them.
    folder = ROOT / source if (ROOT / source).is_dir() else (ROOT / source).parent
    path = (folder / link).resolve()
    return path.relative_to(ROOT).as_posix() if path.exists() and ROOT in path.parents else None


def _outside(page: str, text: str) -> list[str]:
    """Paths outside docs/ that a page links to."""
    found = [_target(page, match[1]) for match in LINK.finditer(text)]
    return [path for path in found if path is not None and not path.startswith('docs/')]


def _shown(path: str) -> str:
    """Page of a file or a folder of the repository."""
    place = ROOT / path
    if place.is_dir():
        inside = sorted(p for p in place.iterdir() if p.name not in SKIPPED and p.name[0] != '.')
        inside = [p for p in inside if p.suffix != '.egg-info']
        lines = [f'- [{p.name}{"/" if p.is_dir() else ""}]({p.name})' for p in inside]
        return '\n'.join([f'# {path}', '', *lines, ''])
    text = place.read_text(encoding='utf-8')
    if place.suffix == '.md':
        return text
    if place.suffix == '.ipynb':
        return _notebook(text)
    return f'# {path}\n\n````{LANGUAGES.get(place.suffix, "text")}\n{text}````\n'


def _notebook(text: str) -> str:
    """Page of a notebook: its texts, and its code as fences."""
    parts = []
    for cell in json.loads(text)['cells']:
        source = ''.join(cell['source'])
        if cell['cell_type'] == 'code':
            parts.append(f'```python\n{source}\n```')
        else:
            parts.append(re.sub(r'\$\$(.+?)\$\$', r'```math\n\1\n```', source, flags=re.DOTALL))
    return '\n\n'.join(parts) + '\n'


def _names(title: str, module: str) -> str:
    """Page on the public names of a module, those of its ``__all__``."""
    lines = [f'# {title}', '', f'::: {module}', '    options:', '      members: false', '']
    for name in public_names(module):
        lines += [f'::: {module}.{name}', '']
    return '\n'.join(lines)


def public_names(module: str) -> list[str]:
    """Names in ``__all__`` of a module of this repository."""
    package, *rest = module.split('.')
    path = ROOT.joinpath(package, package, *rest, '__init__.py')
    for node in ast.parse(path.read_text(encoding='utf-8')).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == '__all__':
            return list(ast.literal_eval(node.value))
    raise ValueError(f'{path}: no __all__')


def _messages() -> str:
    """Page on the messages, services and actions, as they are defined."""
    lines = [
        '# Messages, services and actions',
        '',
        'The definitions of the package `tp_interfaces`; [topics and services](interface.md) says',
        'where they are used.',
        '',
    ]
    kinds = {'msg': 'message', 'srv': 'service', 'action': 'action'}
    for folder, kind in kinds.items():
        for path in sorted((ROOT / 'tp_interfaces' / folder).glob(f'*.{folder}')):
            text = path.read_text(encoding='utf-8')
            lines += [f'## {path.stem} ({kind})', '', '```python', text.rstrip(), '```', '']
    return '\n'.join(lines)


def _display(
    source: str, language: str, class_name: str, options: Any, md: Markdown, **_: Any
) -> str:
    """MathML of an equation on its own."""
    return f'<div class="{class_name}">{convert(source.strip(), display="block")}</div>'


class _Math(Extension):
    """``$…$`` inside a text, and the double colon before a literal block of a docstring."""

    def extendMarkdown(self, md: Markdown) -> None:  # noqa: N802 - a name of Markdown
        # Behind code, before everything that reads a backslash or an underscore.
        md.inlinePatterns.register(
            _Inline(r'(?<![\\$])\$(?![\s$])([^$]+?)(?<![\s\\])\$(?!\d)', md), 'math', 185
        )
        # Behind fences, whose texts are put aside by then.
        md.preprocessors.register(_LiteralBlocks(md), 'literal blocks', 24)


class _LiteralBlocks(Preprocessor):
    def run(self, lines: list[str]) -> list[str]:
        plain = [re.sub(r'(?<=[\w)\]`.]) ?::$', ':', line) for line in lines]
        return ['' if line == '::' else line for line in plain]


class _Inline(InlineProcessor):
    def handleMatch(  # type: ignore[override] # noqa: N802 - a name of Markdown
        self, m: re.Match[str], data: str
    ) -> tuple[Element | str, int, int]:
        text = convert(m[1].replace('\n', ' '), display='inline')
        return self.md.htmlStash.store(text), m.start(0), m.end(0)
