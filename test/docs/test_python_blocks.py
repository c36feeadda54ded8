"""The Python blocks of README.md and docs are run: those of one page in one process, in order."""

import os
import re
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
from shown_programs import workplace

from tp_sim.harness import Process

pytestmark = pytest.mark.timeout(300)

SHORTER = {'batches.md': {'runs=300': 'runs=2', "'hqp', 17": "'hqp', 1"}}
"""Texts of blocks that would take minutes, and what is run in their place."""
PATIENCE = 120.0
"""Time [s] for what takes some seconds on an idle machine."""


def script(text):
    """Python blocks of a page, each line where it is on the page."""
    lines, language = [], None
    for line in text.splitlines():
        fence = re.match(r' *```(\w*)', line)
        if fence:
            language = None if language is not None else fence[1]
        lines.append(line if language == 'python' and not fence else '')
    return '\n'.join(lines) + '\n'


def run(name, text, folder):
    """Run the blocks of a page as a program; return what went wrong."""
    path = folder / f'{name.removesuffix(".md").lower()}_blocks.py'
    path.write_text(text)
    process = Process(name, [sys.executable, str(path)], dict(os.environ), folder)
    try:
        status = process.wait(PATIENCE)
    finally:
        if process.running:
            process.kill()
    return f'{name}: status {status}\n{process.output}' if status else ''


def test_every_python_block_runs(repository, tmp_path):
    folder = workplace(repository, tmp_path)
    scripts = {}
    for path in (repository / 'README.md', *sorted((repository / 'docs').glob('*.md'))):
        text = script(path.read_text(encoding='utf-8'))
        for long, shorter in SHORTER.get(path.name, {}).items():
            assert long in text, f'{path.name}: {long}'
            text = text.replace(long, shorter)
        if text.strip():
            scripts[path.name] = text
    with ThreadPoolExecutor(2) as pool:
        wrong = pool.map(lambda item: run(*item, folder), scripts.items())
    assert not any(wrong), '\n'.join(wrong)
    assert len(scripts) > 6


def test_an_error_names_the_line_of_the_page(tmp_path):
    fences = ('```python', 'x = 1', '```', '', '```', 'make demo', '```', '', '```python')
    page = '\n'.join(('A page.', '', *fences, 'assert x == 2', '```'))
    said = run('page.md', script(page), tmp_path)
    assert 'line 12' in said
    assert 'AssertionError' in said
