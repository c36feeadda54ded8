"""viser's page with a script before its own: what it changes for browsers without a card."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

from viser import infra

SMOOTH = 'smooth'
"""In the address of the page: edges are smooth without a graphics card, too."""
SOFTWARE = 'swiftshader|llvmpipe|softpipe|software|basic render'
"""Names of renderers that use no graphics card."""
RESOLUTION = 'fixedDpr'
"""In the address of the page: pixels that viser draws for one of the window, in each direction."""
PIXELS = 820 * 480
"""So many pixels are drawn without a graphics card; in larger windows they are larger."""
SCRIPT = f"""<script>
(() => {{
  // Smooth edges take half the time of a browser without a graphics card.
  const given = new URLSearchParams(location.search);
  if (given.has('{SMOOTH}')) return;
  const own = HTMLCanvasElement.prototype.getContext;
  const gl = own.call(document.createElement('canvas'), 'webgl2');
  const info = gl && gl.getExtension('WEBGL_debug_renderer_info');
  if (!info || !/{SOFTWARE}/i.test(gl.getParameter(info.UNMASKED_RENDERER_WEBGL))) return;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {{
    const rough = kind.startsWith('webgl') ? {{...options, antialias: false}} : options;
    return own.call(this, kind, rough);
  }};
  const share = Math.sqrt({PIXELS} / (innerWidth * innerHeight));
  if (share < 1 && !given.has('{RESOLUTION}')) {{
    given.set('{RESOLUTION}', share.toFixed(2));
    history.replaceState(null, '', `?${{given}}`);
  }}
}})();
</script>"""


class SiteServer(infra.WebsockServer):
    """viser's server with the script in its page.

    Attributes
    ----------
    site
        Folder of the page; who closes the server removes it.
    """

    def __init__(self, *, http_server_root: Path, **options: Any) -> None:
        self.site = tempfile.TemporaryDirectory(prefix='tp_view_', ignore_cleanup_errors=True)
        root = Path(self.site.name)
        shutil.copytree(http_server_root, root, dirs_exist_ok=True)
        page = root / 'index.html'
        text = page.read_text(encoding='utf-8')
        page.write_text(text.replace('<head>', f'<head>{SCRIPT}', 1), encoding='utf-8')
        super().__init__(http_server_root=root, **options)
