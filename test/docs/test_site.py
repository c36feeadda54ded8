"""The docs site is built strictly, has every public name, and loads nothing from elsewhere."""

import os
import re
import runpy
import subprocess
import sys

import pytest

# It is built once, on cores that may be busy.
pytestmark = pytest.mark.timeout(600)


@pytest.fixture(scope='module')
def site(repository, tmp_path_factory):
    out = tmp_path_factory.mktemp('site')
    built = subprocess.run(
        [sys.executable, '-m', 'mkdocs', 'build', '--strict', '--quiet', '-d', str(out)],
        cwd=repository,
        env={**os.environ, 'NO_MKDOCS_2_WARNING': '1'},
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    return out


def test_every_page_is_there_and_loads_nothing_from_elsewhere(repository, site):
    pages = {path.stem for path in (repository / 'docs').glob('*.md')}
    assert {path.stem for path in site.glob('*.html')} >= pages | {'index', 'changelog'}
    for path in site.rglob('*.html'):
        text = path.read_text(encoding='utf-8')
        assert not re.search(r'<(?:script|img)[^>]+src="?(?:https?:)?//', text), path
        assert not re.search(r'<link[^>]+href="?(?:https?:)?//', text), path


def test_every_public_name_is_in_the_reference(repository, site):
    hooks = runpy.run_path(str(repository / 'tools' / 'docs_site.py'))
    for page, (_, module) in hooks['REFERENCE'].items():
        text = (site / page).with_suffix('.html').read_text(encoding='utf-8')
        names = hooks['public_names'](module)
        assert len(names) >= 5
        for name in names:
            assert f'id="{module}.{name}"' in text, name


def test_equations_are_drawn_by_the_browser_alone(site):
    text = (site / 'schemes.html').read_text(encoding='utf-8')
    assert text.count('<math') > 50
    assert '$' not in re.sub(r'<(pre|code|script).*?</\1>', '', text, flags=re.DOTALL)


def test_links_to_files_outside_docs_lead_to_pages(site):
    robots = (site / 'robots.html').read_text(encoding='utf-8')
    assert 'href="index.html#bring-your-own-robot"' in robots
    spaces = (site / 'spaces.html').read_text(encoding='utf-8')
    assert 'href="files/config/mobile_planar.yaml.html"' in spaces
    assert 'mobile' in (site / 'files' / 'config' / 'mobile_planar.yaml.html').read_text()
